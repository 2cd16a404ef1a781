import { describe, expect, test } from "vitest";
import { readPage } from "../../../packages/umbel/src/decode/page.js";
import { UmbelError } from "../../../packages/umbel/src/errors.js";
import type { AttributeName } from "../../../packages/umbel/src/format/attributes.js";
import { type FileHeader, readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import { readFixedHeader } from "../../../packages/umbel/src/format/sections.js";
import { xxh64 } from "../../../packages/umbel/src/format/xxh64.js";
import { assetBytes, assetNames, expectedOf, floats, words } from "../../support/assets.js";

function pageBytes(file: Uint8Array, { pages }: FileHeader, page: number): Uint8Array {
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
  const head = readFileHeader(file);
  const expected = expectedOf(name);

  test("its head is as the reference reader has it", () => {
    expect(head.groups).toBe(expected.groups);
    expect(head.clusters).toBe(words(expected.triangles).length);
    expect(head.meshes[0]?.levels ?? 0).toBe(expected.levels.length);
    expect(head.meshes[0]?.sourceTriangles ?? 0).toBe(expected.source_triangles);
  });

  test("its pages are what the reference reader decodes", () => {
    for (const [page, wanted] of Object.entries(expected.pages)) {
      const groups = readPage(head, Number(page), pageBytes(file, head, Number(page)));
      expect(groups.length).toBe(wanted.length);
      groups.forEach(({ info, indices, values }, i) => {
        const group = wanted[i];
        expect({ ...info, references: undefined }).toMatchObject({
          group: group.group,
          mesh: group.mesh,
          firstCluster: group.first_cluster,
          level: group.level,
          method: group.method,
          parents: group.parents,
        });
        expect([...info.sphere, info.error]).toEqual([...floats(group.sphere)]);
        expect(info.references.map((r) => [r.group, r.page, r.parents])).toEqual(group.references);
        expect([...info.generating]).toEqual(group.made_from);
        expect([...info.material]).toEqual(group.materials);
        expect(info.boxes).toEqual(floats(group.boxes));
        group.clusters.forEach(({ triangles, ...attributes }, c) => {
          const [from, to] = [info.vertexOffsets[c], info.vertexOffsets[c + 1]];
          const mine = indices
            .subarray(3 * info.triangleOffsets[c], 3 * info.triangleOffsets[c + 1])
            .map((index) => index - from);
          expect(mine).toEqual(words(triangles));
          expect(Object.keys(attributes).sort()).toEqual(Object.keys(values).sort());
          for (const [attribute, base64] of Object.entries(attributes)) {
            const right = floats(base64);
            const width = right.length / (to - from);
            const all = values[attribute as AttributeName] as Float32Array;
            const decoded = all.subarray(width * from, width * to);
            if (attribute === "positions") expect(decoded).toEqual(right);
            else expect(farthest(decoded, right)).toBeLessThan(2e-5);
          }
        });
      });
    }
  });

  test("every page of it decodes", () => {
    const triangles = words(expected.triangles);
    let groups = 0;
    for (let page = 0; page < head.pages.count; ++page)
      for (const { info } of readPage(head, page, pageBytes(file, head, page))) {
        ++groups;
        for (let i = 0; i < info.clusterCount; ++i)
          expect(info.triangleOffsets[i + 1] - info.triangleOffsets[i]).toBe(
            triangles[info.firstCluster + i],
          );
      }
    expect(groups).toBe(head.groups);
  });
});

describe("damage", () => {
  const file = assetBytes("planet");
  const head = readFileHeader(file);

  test("is found in every byte of the head", () => {
    for (let at = 0; at < head.fixed.headerBytes; at += 13) {
      const bad = file.slice(0, head.fixed.headerBytes);
      bad[at] ^= 0x10;
      expect(kindOf(() => readFileHeader(bad))).not.toBe("none");
    }
  });

  test("is found in every byte of a page", () => {
    const page = Uint8Array.from(pageBytes(file, head, 1));
    for (let at = 0; at < page.length; at += 997) {
      page[at] ^= 0x04;
      expect(kindOf(() => readPage(head, 1, page))).toBe("corrupt");
      page[at] ^= 0x04;
    }
    expect(kindOf(() => readPage(head, 1, page))).toBe("none");
  });

  test("is found where the file is cut off", () => {
    for (const size of [0, 15, 16, 127, 128, 500, head.fixed.headerBytes - 1])
      expect(["not-umbel", "corrupt"]).toContain(kindOf(() => readFileHeader(file.slice(0, size))));
  });

  test("never does more than throw an UmbelError, whatever the bytes under a right checksum", () => {
    const original = Uint8Array.from(pageBytes(file, head, 0));
    let seed = 12345;
    const random = (below: number) => {
      seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
      return Math.floor((seed / 2 ** 32) * below);
    };
    let refused = 0;
    for (let round = 0; round < 120; ++round) {
      const bad = original.slice();
      // Every other round in what says where everything is.
      const reach = round % 2 ? bad.length : 400;
      for (let i = 0; i <= random(3); ++i) bad[random(reach)] = random(256);
      const [high, low] = xxh64(bad);
      head.pages.checksum[0] = low;
      head.pages.checksum[1] = high;
      if (kindOf(() => readPage(head, 0, bad)) !== "none") ++refused;
    }
    expect(refused).toBeGreaterThan(20);
  });

  test("a file of something else is said to be no .umbel file", () => {
    const other = new TextEncoder().encode("<!doctype html><title>not found</title>".repeat(9));
    expect(kindOf(() => readFixedHeader(other))).toBe("not-umbel");
  });

  test("a file of another major version is said to be that", () => {
    const other = file.slice(0, 128);
    other[8] = 2;
    expect(kindOf(() => readFixedHeader(other))).toBe("version");
  });
});
