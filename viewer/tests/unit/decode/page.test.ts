import { describe, expect, test } from "vitest";
import { readPage } from "../../../packages/umbel/src/decode/page.js";
import type { AttributeName } from "../../../packages/umbel/src/format/attributes.js";
import { type FileHeader, readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import { xxh64 } from "../../../packages/umbel/src/format/xxh64.js";
import { assetBytes, assetNames, expectedOf, floats, words } from "../../support/assets.js";
import { kindOf } from "../../support/error_kind.js";
import { Random } from "../../support/random.js";

function pageBytes(file: Uint8Array, { pages }: FileHeader, page: number): Uint8Array {
  return file.subarray(pages.offset[page], pages.offset[page] + pages.size[page]);
}

function maxDifference(a: Float32Array, b: Float32Array): number {
  expect(a.length).toBe(b.length);
  return a.reduce((max, value, i) => Math.max(max, Math.abs(value - b[i])), 0);
}

describe.each(assetNames())("%s", (name) => {
  const file = assetBytes(name);
  const header = readFileHeader(file);
  const expected = expectedOf(name);

  test("its pages equal the reference reader's", () => {
    for (const [page, wanted] of Object.entries(expected.pages)) {
      const groups = readPage(header, Number(page), pageBytes(file, header, Number(page)));
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
          const decodedTriangles = indices
            .subarray(3 * info.triangleOffsets[c], 3 * info.triangleOffsets[c + 1])
            .map((index) => index - from);
          expect(decodedTriangles).toEqual(words(triangles));
          expect(Object.keys(attributes).sort()).toEqual(Object.keys(values).sort());
          for (const [attribute, base64] of Object.entries(attributes)) {
            const reference = floats(base64);
            const width = reference.length / (to - from);
            const all = values[attribute as AttributeName] as Float32Array;
            const decoded = all.subarray(width * from, width * to);
            if (attribute === "positions") expect(decoded).toEqual(reference);
            else expect(maxDifference(decoded, reference)).toBeLessThan(2e-5);
          }
        });
      });
    }
  });

  test("all of its pages decode", () => {
    const triangles = words(expected.triangles);
    let groups = 0;
    for (let page = 0; page < header.pages.count; ++page)
      for (const { info } of readPage(header, page, pageBytes(file, header, page))) {
        ++groups;
        for (let i = 0; i < info.clusterCount; ++i)
          expect(info.triangleOffsets[i + 1] - info.triangleOffsets[i]).toBe(
            triangles[info.firstCluster + i],
          );
      }
    expect(groups).toBe(header.groups);
  });
});

describe("damage", () => {
  const file = assetBytes("planet");
  const header = readFileHeader(file);

  test("is found in every byte of a page", () => {
    const page = Uint8Array.from(pageBytes(file, header, 1));
    for (let at = 0; at < page.length; at += 997) {
      page[at] ^= 0x04;
      expect(kindOf(() => readPage(header, 1, page))).toBe("corrupt");
      page[at] ^= 0x04;
    }
    expect(kindOf(() => readPage(header, 1, page))).toBe("none");
  });

  test("with a valid checksum throws nothing but UmbelErrors", () => {
    const original = Uint8Array.from(pageBytes(file, header, 0));
    const random = new Random(12345);
    let rejected = 0;
    for (let round = 0; round < 120; ++round) {
      const bad = original.slice();
      // Every other round damages the records before the geometry.
      const range = round % 2 ? bad.length : 400;
      for (let i = 0; i <= random.below(3); ++i) bad[random.below(range)] = random.below(256);
      const [high, low] = xxh64(bad);
      header.pages.checksum[0] = low;
      header.pages.checksum[1] = high;
      if (kindOf(() => readPage(header, 0, bad)) !== "none") ++rejected;
    }
    expect(rejected).toBeGreaterThan(20);
  });
});
