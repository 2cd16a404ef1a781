import { describe, expect, test } from "vitest";
import { readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import { readFixedHeader } from "../../../packages/umbel/src/format/sections.js";
import { assetBytes, assetNames, expectedOf, words } from "../../support/assets.js";
import { kindOf } from "../../support/error_kind.js";
import { jsonSection, originSection, sealFileHeader, withSections } from "../../support/rewrite.js";

test.each(assetNames())("the file header of %s equals the reference reader's", (name) => {
  const header = readFileHeader(assetBytes(name));
  const expected = expectedOf(name);
  expect(header.groups).toBe(expected.groups);
  expect(header.clusters).toBe(words(expected.triangles).length);
  expect(header.meshes[0]?.levels ?? 0).toBe(expected.levels.length);
  expect(header.meshes[0]?.sourceTriangles ?? 0).toBe(expected.source_triangles);
});

describe("damage", () => {
  const file = assetBytes("planet");
  const header = readFileHeader(file);

  test("is found in every byte of the file header", () => {
    for (let at = 0; at < header.fixed.headerBytes; at += 13) {
      const bad = file.slice(0, header.fixed.headerBytes);
      bad[at] ^= 0x10;
      expect(kindOf(() => readFileHeader(bad))).not.toBe("none");
    }
  });

  test("is found in truncated files", () => {
    for (const size of [0, 15, 16, 127, 128, 500, header.fixed.headerBytes - 1])
      expect(["not-umbel", "corrupt"]).toContain(kindOf(() => readFileHeader(file.slice(0, size))));
  });
});

test("another kind of file is rejected as no .umbel file", () => {
  const other = new TextEncoder().encode("<!doctype html><title>not found</title>".repeat(9));
  expect(kindOf(() => readFixedHeader(other))).toBe("not-umbel");
});

test("another major version is rejected as such", () => {
  const other = assetBytes("planet").slice(0, 128);
  other[8] = 2;
  expect(kindOf(() => readFixedHeader(other))).toBe("version");
});

test("sections that are not known may lie behind the file header", () => {
  const name = "ZZZZ";
  const file = withSections(assetBytes("planet"), [{ name, stride: 1, bytes: new Uint8Array(8) }]);
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  for (let row = view.getUint32(12, true); ; row += 40) {
    if (String.fromCharCode(...file.subarray(row, row + 4)) !== name) continue;
    view.setBigUint64(row + 8, BigInt(file.length - 8), true);
    break;
  }
  sealFileHeader(file);
  expect(readFileHeader(file).groups).toBe(expectedOf("planet").groups);
});

describe("optional sections", () => {
  const FILE = assetBytes("blob_16bits_compact");
  const UTM: [number, number, number] = [448_250.125, 5_411_900.5, 312.0625];

  test("origin and scene are read if the file has them", () => {
    const plain = readFileHeader(FILE);
    expect(plain.origin).toEqual([0, 0, 0]);
    expect(plain.scene).toEqual({});
    const scene = { asset: { copyright: "someone" }, nodes: [{ name: "roof" }] };
    const moved = readFileHeader(
      withSections(FILE, [originSection(...UTM), jsonSection("SCEN", scene)]),
    );
    expect(moved.origin).toEqual(UTM);
    expect(moved.scene).toEqual(scene);
    expect({ ...moved.meshes[0], roots: 0 }).toEqual({ ...plain.meshes[0], roots: 0 });
    expect(readFileHeader(withSections(FILE, [originSection()])).origin).toEqual([0, 0, 0]);
  });

  test("an origin that is not finite is rejected", () => {
    for (const bad of [originSection(1, Number.NaN, 2), originSection(1, 2, 3, 4, 5, 6)])
      expect(() => readFileHeader(withSections(FILE, [bad]))).toThrow("origin");
  });
});
