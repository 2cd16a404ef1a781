import { describe, expect, test } from "vitest";
import type { AttributeName } from "../../packages/umbel/src/attributes.js";
import { UmbelError } from "../../packages/umbel/src/errors.js";
import { readPage } from "../../packages/umbel/src/page.js";
import { readHeader, readTables, type Tables } from "../../packages/umbel/src/tables.js";
import { xxh64 } from "../../packages/umbel/src/xxh64.js";
import { assetBytes, assetNames, floats, said, words } from "../assets.js";

function pageBytes(file: Uint8Array, { pages }: Tables, page: number): Uint8Array {
  return file.subarray(pages.offset[page], pages.offset[page] + pages.size[page]);
}

function farthest(a: Float32Array, b: Float32Array): number {
  expect(a.length).toBe(b.length);
  return a.reduce((most, value, i) => Math.max(most, Math.abs(value - b[i])), 0);
}

function kindOf(action: () => unknown): string {
  try {
    action();
  } catch (error) {
    if (error instanceof UmbelError) return error.kind;
    throw error;
  }
  return "none";
}

test("checksums are those of the specification", () => {
  const hex = (text: string) =>
    xxh64(new TextEncoder().encode(text))
      .map((half) => half.toString(16).padStart(8, "0"))
      .join("");
  expect(hex("")).toBe("ef46db3751d8e999");
  expect(hex("a")).toBe("d24ec4f1a98c6e5b");
  expect(hex("abc")).toBe("44bc2cf5ad770999");
  expect(hex("Nobody inspects the spammish repetition")).toBe("fbcea83c8a378bf1");
});

describe.each(assetNames())("%s", (name) => {
  const file = assetBytes(name);
  const tables = readTables(file);
  const expected = said(name);

  test("its tables are as the reference reader has them", () => {
    const { groups, clusters, levels } = tables;
    expect(levels.map((l) => [l.first, l.count])).toEqual(expected.levels);
    const rows = Array.from({ length: groups.count }, (_, g) => [
      groups.firstCluster[g],
      groups.clusterCount[g],
      groups.level[g],
      groups.rung[g],
    ]);
    expect(rows).toEqual(expected.groups);
    const spheres = floats(expected.spheres);
    for (let g = 0; g < groups.count; ++g) {
      expect(groups.sphere.subarray(4 * g, 4 * g + 4)).toEqual(spheres.subarray(5 * g, 5 * g + 4));
      expect(groups.error[g]).toBe(spheres[5 * g + 4]);
    }
    const table = words(expected.clusters);
    expect(clusters.count).toBe(table.length / 4);
    for (let c = 0; c < clusters.count; ++c)
      expect([
        clusters.generating[c],
        clusters.material[c],
        clusters.vertices[c],
        clusters.triangles[c],
      ]).toEqual([...table.subarray(4 * c, 4 * c + 4)]);
    expect(clusters.box).toEqual(floats(expected.boxes));
  });

  test("its geometry is what the reference reader decodes", () => {
    for (const [name, wanted] of Object.entries(expected.geometry)) {
      const page = tables.groups.page[Number(name)];
      const groups = readPage(tables, page, pageBytes(file, tables, page));
      const group = groups.find((each) => each.group === Number(name));
      if (!group) throw new Error(`the page does not hold group ${name}`);
      expect(group.clusterCount).toBe(wanted.length);
      wanted.forEach(({ triangles, ...values }, i) => {
        const [from, to] = [group.vertexOffsets[i], group.vertexOffsets[i + 1]];
        const indices = group.indices
          .subarray(3 * group.triangleOffsets[i], 3 * group.triangleOffsets[i + 1])
          .map((index) => index - from);
        expect(indices).toEqual(words(triangles));
        expect(Object.keys(values).sort()).toEqual(Object.keys(group.values).sort());
        for (const [attribute, base64] of Object.entries(values)) {
          const wantedValues = floats(base64);
          const width = wantedValues.length / (to - from);
          const all = group.values[attribute as AttributeName] as Float32Array;
          const mine = all.subarray(width * from, width * to);
          if (attribute === "positions") expect(mine).toEqual(wantedValues);
          else expect(farthest(mine, wantedValues)).toBeLessThan(2e-5);
        }
      });
    }
  });

  test("every page of it decodes", () => {
    let clusters = 0;
    for (let page = 0; page < tables.pages.count; ++page)
      for (const group of readPage(tables, page, pageBytes(file, tables, page)))
        clusters += group.clusterCount;
    expect(clusters).toBe(tables.clusters.count);
  });
});

describe("damage", () => {
  const file = assetBytes("blob_16bits_compact");
  const tables = readTables(file);

  test("is found in every byte of the head", () => {
    for (let at = 0; at < tables.header.headBytes; at += 97) {
      const bad = file.slice(0, tables.header.headBytes);
      bad[at] ^= 0x10;
      expect(kindOf(() => readTables(bad))).not.toBe("none");
    }
  });

  test("is found in every byte of a page", () => {
    const page = Uint8Array.from(pageBytes(file, tables, 3));
    for (let at = 0; at < page.length; at += 101) {
      page[at] ^= 0x04;
      expect(kindOf(() => readPage(tables, 3, page))).toBe("corrupt");
      page[at] ^= 0x04;
    }
    expect(kindOf(() => readPage(tables, 3, page))).toBe("none");
  });

  test("is found where the file is cut off", () => {
    for (const size of [0, 15, 16, 127, 128, 500, tables.header.headBytes - 1])
      expect(["not-umbel", "corrupt"]).toContain(kindOf(() => readTables(file.slice(0, size))));
  });

  test("never does more than throw an UmbelError, whatever the bytes under a right checksum", () => {
    const original = Uint8Array.from(pageBytes(file, tables, 0));
    let seed = 12345;
    const random = (below: number) => {
      seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
      return Math.floor((seed / 2 ** 32) * below);
    };
    let refused = 0;
    for (let round = 0; round < 300; ++round) {
      const bad = original.slice();
      for (let i = 0; i <= random(3); ++i) bad[random(bad.length)] = random(256);
      const [high, low] = xxh64(bad);
      tables.pages.checksum[0] = low;
      tables.pages.checksum[1] = high;
      if (kindOf(() => readPage(tables, 0, bad)) !== "none") ++refused;
    }
    expect(refused).toBeGreaterThan(30);
  });

  test("a file of something else is said to be no .umbel file", () => {
    const other = new TextEncoder().encode("<!doctype html><title>not found</title>".repeat(9));
    expect(kindOf(() => readHeader(other))).toBe("not-umbel");
  });

  test("a file of another major version is said to be that", () => {
    const other = file.slice(0, 128);
    other[8] = 9;
    expect(kindOf(() => readHeader(other))).toBe("version");
  });
});
