import { describe, expect, it } from "vitest";
import { decodeValues } from "../../../packages/umbel/src/decode/attribute_values.js";
import type { Attribute } from "../../../packages/umbel/src/format/attributes.js";

function attribute(name: Attribute["name"], coding: number, bits: number, components: number) {
  return { name, coding, bits, components, step: 1, isSmooth: false, kind: 0 } as Attribute;
}

function linear(s: number): number {
  return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
}

// Few bits go through tables; more of them, and integers that a writer should not have written, do
// not.
describe.each([1, 8, 12, 13, 16])("integers of %i bits", (bits) => {
  const last = 2 ** bits - 1;
  const integers = [0, 1, last >> 1, last, last + 1, -1, 2 ** 31 - 1, -(2 ** 31)];

  it("become linear colours", () => {
    const rows = Int32Array.from(integers.flatMap((i) => [i, i, i, i]));
    const { colors } = decodeValues([attribute("colors", 4, bits, 4)], rows, 4, integers.length);
    const expected = integers.flatMap((i) => {
      const s = i / last;
      return [linear(s), linear(s), linear(s), s];
    });
    expect(colors).toEqual(Float32Array.from(expected));
  });

  it("become tangents", () => {
    // Normals along z, whose basis is x and y.
    const rows = Int32Array.from(integers.flatMap((i, v) => [0, 0, i, v % 2]));
    const attributes = [attribute("normals", 2, 10, 2), attribute("tangents", 3, bits, 2)];
    const { tangents } = decodeValues(attributes, rows, 4, integers.length);
    integers.forEach((i, v) => {
      const angle = (2 * Math.PI * i) / 2 ** bits;
      const found = tangents?.subarray(4 * v, 4 * v + 4);
      expect(found?.[0]).toBeCloseTo(Math.cos(angle), 6);
      expect(found?.[1]).toBeCloseTo(Math.sin(angle), 6);
      expect(found?.[2]).toBeCloseTo(0, 6);
      expect(found?.[3]).toBe(v % 2 === 1 ? -1 : 1);
    });
  });
});
