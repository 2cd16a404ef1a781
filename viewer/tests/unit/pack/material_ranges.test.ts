import { expect, test } from "vitest";
import { materialRangesOf } from "../../../packages/umbel/src/pack/material_ranges.js";
import { squareGroup } from "../../support/square_group.js";

test("sorts the triangles of a cluster that mixes materials", () => {
  const plain = materialRangesOf(squareGroup(1));
  expect([...plain.rangeOffsets]).toEqual([0, 1, 2]);
  expect([...plain.rangeMaterials]).toEqual([7, 9]);
  const mixed = squareGroup(1, [3, 1, 1, 1, 2, 2, 2, 2]);
  mixed.indices.set([0, 1, 2, 1, 2, 3]);
  const parts = materialRangesOf(mixed);
  expect([...parts.rangeOffsets]).toEqual([0, 2, 3]);
  expect([...parts.rangeMaterials]).toEqual([1, 3, 2]);
  expect([...parts.rangeTriangles]).toEqual([0, 1, 2, 4]);
  expect([...mixed.indices.subarray(0, 6)]).toEqual([1, 2, 3, 0, 1, 2]);
});
