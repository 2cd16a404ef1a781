import { describe, expect, test } from "vitest";
import { readPage } from "../../../packages/umbel/src/decode/page.js";
import { UmbelError } from "../../../packages/umbel/src/errors.js";
import { readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import { xxh64 } from "../../../packages/umbel/src/format/xxh64.js";
import { corpus } from "../../fuzz/corpus.js";
import { allocated } from "../../fuzz/watch.js";
import {
  fileHeaderSections,
  type Section,
  sealFileHeader,
  withSections,
} from "../../support/rewrite.js";

const FILE = corpus().find(({ name }) => name === "compact.umbel")?.file as Uint8Array;
const HEADER = readFileHeader(FILE);
/** Of version 3, whose records of clusters are words. */
const FILE_3 = corpus().find(({ name }) => name === "grid.umbel")?.file as Uint8Array;
const MAX_BYTES = 1 << 18;

/** Bytes that a reader allocates until it rejects the input, and its message. */
function rejection(action: () => unknown): { taken: number; message: string } {
  let message = "";
  const taken = allocated(() => {
    try {
      action();
    } catch (error) {
      if (!(error instanceof UmbelError)) throw error;
      message = error.message;
    }
  });
  return { taken, message };
}

function section(name: string): Section {
  return fileHeaderSections(FILE).find((each) => each.name === name) as Section;
}

/** The file with words of a section changed, by their offset in it. */
function withWords(name: string, words: readonly [number, number][]): Uint8Array {
  const changed = section(name);
  const view = new DataView(changed.bytes.buffer);
  for (const [at, value] of words) view.setUint32(at, value, true);
  return withSections(FILE, [changed]);
}

/** Reads a page with words changed. */
function readChanged(page: number, words: readonly [number, number][], file = FILE): unknown {
  const header = readFileHeader(file);
  const { offset, size, checksum } = header.pages;
  const bytes = file.slice(offset[page], offset[page] + size[page]);
  const view = new DataView(bytes.buffer);
  for (const [at, value] of words) view.setUint32(at, value, true);
  const head = { ...header, pages: { ...header.pages, checksum: checksum.slice() } };
  const [high, low] = xxh64(bytes);
  head.pages.checksum.set([low, high], 2 * page);
  return readPage(head, page, bytes);
}

describe("a reader rejects few bytes that claim much memory", () => {
  test("by more groups than pages can hold", () => {
    const many = 2 ** 25;
    const others = HEADER.groups - HEADER.pages.groups[0];
    const pages = withSections(withWords("PAGE", [[12, many]]), [
      (() => {
        const meshes = section("MESH");
        new DataView(meshes.bytes.buffer).setUint32(80, many + others, true);
        return meshes;
      })(),
    ]);
    const { taken, message } = rejection(() => readFileHeader(pages));
    expect(message).toContain("cannot hold its groups");
    expect(taken).toBeLessThan(MAX_BYTES);
  });

  test("by more clusters than pages can hold", () => {
    const { message } = rejection(() => readFileHeader(withWords("MESH", [[84, 2 ** 28]])));
    expect(message).toContain("cannot hold all clusters");
  });

  test("by groups that overlap", () => {
    const page = [...HEADER.pages.groups].findIndex((groups) => groups > 1);
    expect(page).toBeGreaterThanOrEqual(0);
    const bytes = FILE.slice(HEADER.pages.offset[page]);
    const first = new DataView(bytes.buffer).getUint32(16 + 52, true);
    const { message } = rejection(() => readChanged(page, [[16 + 64 + 52, first]]));
    expect(message).toContain("overlap");
  });

  test("by clusters that exceed the file's limits or their bytes", () => {
    const header = readFileHeader(FILE_3);
    const start = header.pages.offset[0];
    const view = new DataView(FILE_3.buffer, FILE_3.byteOffset + start);
    const part = view.getUint32(16 + 52, true);
    const references = view.getUint32(16 + 28, true);
    const row = part + 32 * references + 8 * header.meshes[0].smooth.length;
    const kept = view.getUint32(row + 4, true);
    const sizes: [number, number][] = [
      [row + 4, (kept & 0xffff0000) | 0xffff],
      [row, row - part + 25],
    ];
    for (const change of sizes) {
      const { taken, message } = rejection(() => readChanged(0, [change], FILE_3));
      expect(message).toContain("larger than the file says");
      expect(taken).toBeLessThan(MAX_BYTES);
    }
  });
});

test("a file that is only written again stays the same", () => {
  const again = Uint8Array.from(FILE);
  sealFileHeader(again);
  expect(again).toEqual(FILE);
  const { origin, meshes, pages } = readFileHeader(withSections(FILE, []));
  expect({ origin, clusters: meshes[0].clusters, groups: [...pages.groups] }).toEqual({
    origin: HEADER.origin,
    clusters: HEADER.meshes[0].clusters,
    groups: [...HEADER.pages.groups],
  });
});
