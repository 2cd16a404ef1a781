import { PerspectiveCamera, type WebGLRenderer } from "three";
import { afterEach, describe, expect, test, vi } from "vitest";
import { HttpSource } from "../../../packages/umbel/src/source/http_source.js";
import { assetInfoOf } from "../../../packages/umbel/src/stream/asset_info.js";
import { UmbelMesh } from "../../../packages/umbel/src/three/umbel_mesh.js";
import type { AssetStream } from "../../../packages/umbel/src/worker/asset_stream.js";
import { loadAsset } from "../../support/loaded_asset.js";

/** A mesh without a worker. */
function meshOf(options = {}): UmbelMesh {
  const stream = { info: assetInfoOf(loadAsset("planet").header), budget: 2 ** 28, setBudget() {} };
  return new UmbelMesh(stream as unknown as AssetStream, options);
}

describe.each([Number.NaN, -1, Infinity, "256", true, {}])("%j", (wrong) => {
  const value = wrong as number;

  test.each(["budget", "pixelError", "offscreen"])("is refused as %s", async (name) => {
    const refusal = new RegExp(`\`${name}\` must be a finite number`);
    await expect(UmbelMesh.load("a.umbel", { [name]: value })).rejects.toThrow(refusal);
    if (name !== "budget") expect(() => meshOf({ [name]: value })).toThrow(refusal);
  });

  test("is refused by a mesh", () => {
    const mesh = meshOf();
    expect(() => mesh.setBudget(value)).toThrow("`budget` must be a finite number above 0");
    expect(() => {
      mesh.pixelError = value;
    }).toThrow("`pixelError` must be a finite number of at least 0");
    expect(mesh.pixelError).toBe(1);
    if (value !== -1) expect(() => mesh.setSceneOrigin([0, value, 0])).toThrow("`origin` must be");
  });

  test.each(["retries", "delay", "patience"])("is refused as %s", (name) => {
    expect(() => new HttpSource("a.umbel", { [name]: value })).toThrow(`\`${name}\` must be`);
  });
});

test("an error of 0 is allowed, a budget of 0 is not", async () => {
  expect(meshOf({ pixelError: 0, offscreen: 0 }).pixelError).toBe(0);
  await expect(UmbelMesh.load("a.umbel", { budget: 0 })).rejects.toThrow("it is 0.");
});

afterEach(() => {
  vi.unstubAllGlobals();
});

test.each([
  undefined,
  null,
  7,
  new ArrayBuffer(4),
  new Response(""),
  new URL("https://a.test/a.umbel"),
])("what is neither an address nor a Blob is named as such: %s", async (source) => {
  const load = UmbelMesh.load(source as unknown as string);
  await expect(load).rejects.toThrow("`source` must be an address");
});

test("an address is relative to the document, or in a worker to its script", async () => {
  const sources: string[] = [];
  vi.stubGlobal(
    "Worker",
    class {
      onmessage: ((event: { data: object }) => void) | undefined;
      postMessage({ source }: { source: string }) {
        sources.push(source);
        this.onmessage?.({ data: { type: "failed", kind: "missing", message: "not there" } });
      }
      terminate() {}
    },
  );
  vi.stubGlobal("location", { href: "https://a.test/scripts/draw.js" });
  await expect(UmbelMesh.load("a.umbel")).rejects.toThrow("not there");
  vi.stubGlobal("document", { baseURI: "https://a.test/page/" });
  await expect(UmbelMesh.load("a.umbel")).rejects.toThrow("not there");
  expect(sources).toEqual(["https://a.test/scripts/a.umbel", "https://a.test/page/a.umbel"]);
});

test("a worker that the browser refuses is an UmbelError", async () => {
  vi.stubGlobal("document", { baseURI: "https://a.test/" });
  const refuse = () => {
    throw new Error("another origin");
  };
  vi.stubGlobal("Worker", new Proxy(class {}, { construct: refuse }));
  await expect(UmbelMesh.load("a.umbel")).rejects.toMatchObject({
    kind: "unsupported",
    message: "The browser could not start the worker: another origin",
  });
});

test("other renderers than WebGLRenderer are refused", () => {
  const other = { isWebGPURenderer: true } as unknown as WebGLRenderer;
  expect(() => meshOf().update(new PerspectiveCamera(), other)).toThrow("by a WebGLRenderer");
});
