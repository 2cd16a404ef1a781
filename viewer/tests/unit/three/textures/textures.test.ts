import { MeshBasicMaterial, type Texture, type WebGLRenderer } from "three";
import { afterEach, expect, test, vi } from "vitest";
import { UmbelError, type UmbelErrorKind } from "../../../../packages/umbel/src/errors.js";
import { Textures } from "../../../../packages/umbel/src/three/textures/textures.js";
import type { AssetStream } from "../../../../packages/umbel/src/worker/asset_stream.js";

vi.stubGlobal("ImageData", class {});
vi.stubGlobal("createImageBitmap", async () => ({ width: 8, height: 8, close: () => {} }));
afterEach(() => {
  vi.useRealTimers();
});

/** Textures with an image that is in view and that cannot be read `failures` times. */
function unreadable(kind: UmbelErrorKind, failures: number) {
  vi.useFakeTimers();
  const notes = new Set<string>();
  let reads = 0;
  const stream = {
    info: { materials: { textures: [{ source: 0 }], images: [{ file: 0, width: 8, height: 8 }] } },
    readFile: async () => {
      if (++reads <= failures) throw new UmbelError(kind, "");
      return new Uint8Array(4);
    },
  };
  const textures = new Textures(
    stream as unknown as AssetStream,
    "",
    () => {},
    (text, holds = true) => {
      if (holds) notes.add(text);
      else notes.delete(text);
    },
  );
  textures.use(0, new MeshBasicMaterial(), ["map"], { index: 0 }, true, "white");
  textures.setDemand(new Map([[0, [8]]]), {} as WebGLRenderer);
  return { textures, notes, reads: () => reads };
}

test("a texture comes once its server answers again, however late", async () => {
  const { textures, notes } = unreadable("network", 9);
  await vi.advanceTimersByTimeAsync(60_000);
  expect([...notes]).toEqual(["Textures are late: they are requested again until they arrive."]);
  // Larger copies of other images do not wait for it.
  expect(textures.statistics).toMatchObject({ resident: 0, isComplete: true });
  await vi.advanceTimersByTimeAsync(200_000);
  expect(textures.statistics).toMatchObject({ resident: 1, missing: 0 });
  expect(notes.size).toBe(0);
});

test("a damaged texture is given up", async () => {
  const { textures, notes, reads } = unreadable("corrupt", 9);
  await vi.advanceTimersByTimeAsync(200_000);
  expect(reads()).toBe(2);
  expect([...notes]).toEqual(["A texture could not be read."]);
  expect(textures.statistics).toMatchObject({ resident: 0, missing: 0, isComplete: true });
});

test("a texture is as large as its own set of texture coordinates asks for", async () => {
  const stream = {
    info: {
      materials: {
        textures: [{ source: 0 }, { source: 1 }],
        images: [{ file: 0 }, { file: 1 }].map((file) => ({ ...file, width: 4096, height: 4096 })),
      },
    },
    readFile: async () => new Uint8Array(4),
  };
  vi.stubGlobal("createImageBitmap", async (_from: unknown, options?: ImageBitmapOptions) => {
    const side = options?.resizeWidth ?? 4096;
    return { width: side, height: side, close: () => {} };
  });
  const textures = new Textures(
    stream as unknown as AssetStream,
    "",
    () => {},
    () => {},
  );
  const material = new MeshBasicMaterial();
  textures.use(0, material, ["map"], { index: 0 }, true, "white");
  textures.use(0, material, ["lightMap"], { index: 1, texCoord: 1 }, true, "white");
  textures.setDemand(new Map([[0, [100, 1000]]]), {} as WebGLRenderer);
  textures.beginFrame();
  const widthOf = (texture: Texture | null) => (texture?.image as ImageBitmap | undefined)?.width;
  await vi.waitFor(() => expect(textures.statistics.missing).toBe(0), 20_000);
  expect([widthOf(material.map), widthOf(material.lightMap)]).toEqual([128, 1024]);
});

test("once disposed of, textures fetch nothing and report nothing", async () => {
  vi.useFakeTimers();
  const signals: AbortSignal[] = [];
  vi.stubGlobal("fetch", (_address: string, { signal }: { signal: AbortSignal }) => {
    signals.push(signal);
    return new Promise((_resolve, reject) => {
      signal.addEventListener("abort", () => reject(new Error("aborted")));
    });
  });
  const stream = {
    address: "https://a.test/a.umbel",
    info: { materials: { textures: [{ source: 0 }], images: [{ uri: "a.png" }] } },
  };
  const reported = vi.fn();
  const textures = new Textures(stream as unknown as AssetStream, "", reported, reported);
  textures.use(0, new MeshBasicMaterial(), ["map"], { index: 0 }, true, "white");
  textures.setDemand(new Map([[0, [8]]]), {} as WebGLRenderer);
  expect(signals.map(({ aborted }) => aborted)).toEqual([false]);
  textures.dispose();
  await vi.advanceTimersByTimeAsync(200_000);
  expect(signals.map(({ aborted }) => aborted)).toEqual([true]);
  expect(reported).not.toHaveBeenCalled();
});
