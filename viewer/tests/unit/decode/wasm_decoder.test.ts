import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { afterEach, describe, expect, test, vi } from "vitest";
import type { GroupGeometry } from "../../../packages/umbel/src/decode/group.js";
import { readPage } from "../../../packages/umbel/src/decode/page.js";
import { WASM_DIGEST, WASM_SOURCES } from "../../../packages/umbel/src/decode/wasm_module.js";
import { type FileHeader, readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import { GROUP_ROW, PAGE_HEADER } from "../../../packages/umbel/src/format/tables.js";
import { xxh64 } from "../../../packages/umbel/src/format/xxh64.js";
import { corpus } from "../../fuzz/corpus.js";
import { assetBytes, assetNames, ROOT } from "../../support/assets.js";
import { Random } from "../../support/random.js";

function pageBytes(file: Uint8Array, { pages }: FileHeader, page: number): Uint8Array {
  return file.slice(pages.offset[page], pages.offset[page] + pages.size[page]);
}

function allPages(file: Uint8Array, byWasm: boolean): GroupGeometry[] {
  const header = readFileHeader(file);
  return Array.from({ length: header.pages.count }, (_, page) =>
    readPage(header, page, pageBytes(file, header, page), byWasm),
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

test("the module was compiled from today's sources; if not, run `make wasm`", () => {
  const digest = createHash("sha256");
  for (const name of WASM_SOURCES) digest.update(readFileSync(join(ROOT, name)));
  expect(digest.digest("hex")).toBe(WASM_DIGEST);
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

describe("WebAssembly", () => {
  const DECODER = "../../../packages/umbel/src/decode/wasm_decoder.js";

  afterEach(() => {
    vi.unstubAllGlobals();
    vi.doUnmock(DECODER);
    vi.resetModules();
  });

  test("may be forbidden", async () => {
    const file = assetBytes("planet");
    const header = readFileHeader(file);
    const expected = readPage(header, 0, pageBytes(file, header, 0), false);
    const module = vi.fn(function forbidden() {
      throw new WebAssembly.CompileError("a policy forbids it");
    });
    vi.stubGlobal("WebAssembly", Object.create(WebAssembly, { Module: { value: module } }));
    vi.resetModules();
    const again = await import("../../../packages/umbel/src/decode/page.js");
    expect(again.readPage(header, 0, pageBytes(file, header, 0))).toEqual(expected);
    expect(module).toHaveBeenCalledOnce();
  });

  test("it decodes wherever it may", async () => {
    const file = assetBytes("planet");
    const header = readFileHeader(file);
    vi.resetModules();
    const { decodeClusters } = await import(DECODER);
    const spy = vi.fn(decodeClusters);
    vi.doMock(DECODER, () => ({ decodeClusters: spy }));
    const { readPage: read } = await import("../../../packages/umbel/src/decode/page.js");
    const groups = read(header, 0, pageBytes(file, header, 0));
    expect(spy).toHaveBeenCalledTimes(groups.length);
    for (const { value } of spy.mock.results) expect(value).toBeDefined();
  });
});
