import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { afterEach, beforeAll, describe, expect, test, vi } from "vitest";
import type { GroupGeometry } from "../../../packages/umbel/src/decode/group.js";
import { readPage } from "../../../packages/umbel/src/decode/page.js";
import { loadWasm } from "../../../packages/umbel/src/decode/wasm_decoder.js";
import { type FileHeader, readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import { GROUP_ROW, PAGE_HEADER } from "../../../packages/umbel/src/format/tables.js";
import { xxh64 } from "../../../packages/umbel/src/format/xxh64.js";
import { corpus } from "../../fuzz/corpus.js";
import { assetBytes, assetNames, ROOT } from "../../support/assets.js";
import { Random } from "../../support/random.js";

function pageBytes(file: Uint8Array, { pages }: FileHeader, page: number): Uint8Array {
  return file.slice(pages.offset[page], pages.offset[page] + pages.size[page]);
}

function allPages(file: Uint8Array, byWasm: boolean, read = readPage): GroupGeometry[] {
  const header = readFileHeader(file);
  return Array.from({ length: header.pages.count }, (_, page) =>
    read(header, page, pageBytes(file, header, page), byWasm),
  ).flat();
}

/** A digest of groups, which is quick to compare. */
function digestOf(groups: GroupGeometry[]): string {
  const digest = createHash("sha256");
  for (const { info, indices, values } of groups) {
    digest.update(JSON.stringify(info));
    digest.update(indices);
    for (const [name, floats] of Object.entries(values)) digest.update(name).update(floats);
  }
  return digest.digest("hex");
}

/** A digest of all pages, or the message of their error. */
function outcome(file: Uint8Array, byWasm: boolean): string {
  try {
    return digestOf(allPages(file, byWasm));
  } catch (error) {
    return (error as Error).message;
  }
}

/** The same of the first page, whose bytes are other ones. */
function outcomeOfPage(header: FileHeader, bytes: Uint8Array, byWasm: boolean): string {
  try {
    return digestOf(readPage(header, 0, bytes, byWasm));
  } catch (error) {
    return (error as Error).message;
  }
}

const SOURCES = join(ROOT, "viewer/packages/umbel/wasm/sources.json");
const CODE = readFileSync(join(ROOT, "viewer/packages/umbel/src/decode/decoder.wasm"));

beforeAll(() => loadWasm(CODE));

test("the module was compiled from today's sources; if not, run `make wasm`", () => {
  const digest = createHash("sha256");
  const { sha256, sources } = JSON.parse(readFileSync(SOURCES, "utf-8"));
  for (const name of sources) digest.update(readFileSync(join(ROOT, name)));
  expect(digest.digest("hex")).toBe(sha256);
});

/** The header, of a file that has a good one. */
function readable(file: Uint8Array): FileHeader | undefined {
  try {
    return readFileHeader(file);
  } catch {
    return undefined;
  }
}

const files = new Map([
  ...assetNames().map((name) => [name, assetBytes(name)] as const),
  ...corpus().map(({ name, file }) => [name, file] as const),
]);

describe.each([...files])("%s", (name, file) => {
  test("decodes the same by WebAssembly and in TypeScript", () => {
    expect(outcome(file, true)).toBe(outcome(file, false));
  });

  test("ends the same when it is damaged", () => {
    const header = readable(file);
    if (!header?.pages.count) return;
    const page = pageBytes(file, header, 0);
    const random = new Random(name.length);
    for (let round = 0; round < 30; ++round) {
      const bad = page.slice();
      // Behind the page's header and its groups' records, in the tables and the clusters' data.
      const begin = Math.min(PAGE_HEADER + GROUP_ROW * header.pages.groups[0], bad.length - 1);
      for (let i = 0; i <= random.below(3); ++i)
        bad[begin + random.below(bad.length - begin)] = random.below(256);
      const [high, low] = xxh64(bad);
      header.pages.checksum.set([low, high], 0);
      expect(outcomeOfPage(header, bad, true)).toBe(outcomeOfPage(header, bad, false));
    }
  });
});

describe("the module", () => {
  const PAGE = "../../../packages/umbel/src/decode/page.js";
  const DECODER = "../../../packages/umbel/src/decode/wasm_decoder.js";
  const file = assetBytes("planet");
  const header = readFileHeader(file);
  const bytes = pageBytes(file, header, 0);
  const expected = readPage(header, 0, bytes, false);

  /** New instances of the reader and the loader. */
  async function fresh() {
    vi.resetModules();
    const { loadWasm: load } = await import(DECODER);
    const { readPage: read } = await import(PAGE);
    return { load, read };
  }

  afterEach(() => {
    vi.unstubAllGlobals();
    vi.restoreAllMocks();
    vi.resetModules();
  });

  test("decodes once it is loaded", async () => {
    const { load, read } = await fresh();
    const { Instance } = WebAssembly;
    const instance = vi.fn(function made(module: WebAssembly.Module) {
      return new Instance(module);
    });
    vi.stubGlobal("WebAssembly", Object.create(WebAssembly, { Instance: { value: instance } }));
    expect(read(header, 0, bytes)).toEqual(expected);
    expect(instance).not.toHaveBeenCalled();
    await load(CODE);
    expect(read(header, 0, bytes)).toEqual(expected);
    expect(instance).toHaveBeenCalledOnce();
    // After data that it finds damaged there would be another one.
    for (const other of files.values()) allPages(other, true, read);
    expect(instance).toHaveBeenCalledOnce();
  });

  test("is loaded after some bytes", async () => {
    const { read } = await fresh();
    const request = vi.fn(async () => new Response(CODE));
    vi.stubGlobal("fetch", request);
    const compile = vi.spyOn(WebAssembly, "compile");
    for (let at = 0; at < 2 << 20; at += bytes.length) read(header, 0, bytes);
    await vi.waitFor(() => expect(compile).toHaveBeenCalledOnce(), 20_000);
    expect(request).toHaveBeenCalledOnce();
  });

  test("may be forbidden", async () => {
    const { load, read } = await fresh();
    const compile = vi.spyOn(WebAssembly, "compile").mockRejectedValue(new Error("forbidden"));
    await load(CODE);
    expect(compile).toHaveBeenCalledOnce();
    expect(read(header, 0, bytes)).toEqual(expected);
  });

  test.each([
    () => new RangeError("WebAssembly.Instance(): Out of memory"),
    () => new Error("out of memory"),
  ])("may find no memory", async (error) => {
    const { load, read } = await fresh();
    await load(CODE);
    const instance = vi.fn(function made() {
      throw error();
    });
    vi.stubGlobal("WebAssembly", Object.create(WebAssembly, { Instance: { value: instance } }));
    expect(read(header, 0, bytes)).toEqual(expected);
    expect(instance).toHaveBeenCalled();
  });

  test("may be unknown to the browser", async () => {
    const { load, read } = await fresh();
    vi.stubGlobal("WebAssembly", undefined);
    await load(CODE);
    expect(read(header, 0, bytes)).toEqual(expected);
  });
});
