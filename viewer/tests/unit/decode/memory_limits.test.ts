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
const HEAD = readFileHeader(FILE);
const MOST = 1 << 18;

/** Bytes that are taken until a reader refuses, with what it says. */
function refusal(action: () => unknown): { taken: number; says: string } {
  let says = "";
  const taken = allocated(() => {
    try {
      action();
    } catch (error) {
      if (!(error instanceof UmbelError)) throw error;
      says = error.message;
    }
  });
  return { taken, says };
}

function section(name: string): Section {
  return fileHeaderSections(FILE).find((each) => each.name === name) as Section;
}

/** The file with words of a section changed: byte in it, and value. */
function withWords(name: string, words: readonly [number, number][]): Uint8Array {
  const changed = section(name);
  const view = new DataView(changed.bytes.buffer);
  for (const [at, value] of words) view.setUint32(at, value, true);
  return withSections(FILE, [changed]);
}

/** Reads a page with words changed. */
function readChanged(page: number, words: readonly [number, number][]): unknown {
  const { offset, size, checksum } = HEAD.pages;
  const bytes = FILE.slice(offset[page], offset[page] + size[page]);
  const view = new DataView(bytes.buffer);
  for (const [at, value] of words) view.setUint32(at, value, true);
  const head = { ...HEAD, pages: { ...HEAD.pages, checksum: checksum.slice() } };
  const [high, low] = xxh64(bytes);
  head.pages.checksum.set([low, high], 2 * page);
  return readPage(head, page, bytes);
}

describe("few bytes cannot claim much memory", () => {
  test("with more groups than pages can hold", () => {
    const many = 2 ** 25;
    const others = HEAD.groups - HEAD.pages.groups[0];
    const pages = withSections(withWords("PAGE", [[12, many]]), [
      (() => {
        const meshes = section("MESH");
        new DataView(meshes.bytes.buffer).setUint32(80, many + others, true);
        return meshes;
      })(),
    ]);
    const { taken, says } = refusal(() => readFileHeader(pages));
    expect(says).toContain("cannot hold its groups");
    expect(taken).toBeLessThan(MOST);
  });

  test("with more clusters than pages can hold", () => {
    const { says } = refusal(() => readFileHeader(withWords("MESH", [[84, 2 ** 28]])));
    expect(says).toContain("cannot hold all clusters");
  });

  test("with groups that share their bytes", () => {
    const page = [...HEAD.pages.groups].findIndex((groups) => groups > 1);
    expect(page).toBeGreaterThanOrEqual(0);
    const bytes = FILE.slice(HEAD.pages.offset[page]);
    const first = new DataView(bytes.buffer).getUint32(16 + 52, true);
    const { says } = refusal(() => readChanged(page, [[16 + 64 + 52, first]]));
    expect(says).toContain("overlap");
  });

  test("with clusters that are larger than the file says they are, or than their bytes", () => {
    const start = HEAD.pages.offset[0];
    const view = new DataView(FILE.buffer, FILE.byteOffset + start);
    const part = view.getUint32(16 + 52, true);
    const references = view.getUint32(16 + 28, true);
    const row = part + 32 * references + 8 * HEAD.meshes[0].smooth.length;
    const kept = view.getUint32(row + 4, true);
    const sizes: [number, number][] = [
      [row + 4, (kept & 0xffff0000) | 0xffff],
      [row, row - part + 25],
    ];
    for (const change of sizes) {
      const { taken, says } = refusal(() => readChanged(0, [change]));
      expect(says).toContain("larger than the file says");
      expect(taken).toBeLessThan(MOST);
    }
  });
});

test("a file that was only written again is the same", () => {
  const again = Uint8Array.from(FILE);
  sealFileHeader(again);
  expect(again).toEqual(FILE);
  const { origin, meshes, pages } = readFileHeader(withSections(FILE, []));
  expect({ origin, clusters: meshes[0].clusters, groups: [...pages.groups] }).toEqual({
    origin: HEAD.origin,
    clusters: HEAD.meshes[0].clusters,
    groups: [...HEAD.pages.groups],
  });
});
