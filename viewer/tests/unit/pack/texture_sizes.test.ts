import { expect, test } from "vitest";
import type { GroupGeometry } from "../../../packages/umbel/src/decode/group.js";
import { materialRangesOf } from "../../../packages/umbel/src/pack/material_ranges.js";
import { textureSizesOf } from "../../../packages/umbel/src/pack/texture_sizes.js";
import { squareGroup } from "../../support/square_group.js";

/** Material, set of texture coordinates and size of each row. */
function rowsOf(group: GroupGeometry): number[][] {
  const { sizeMaterials, sizeSets, sizes } = textureSizesOf(group, materialRangesOf(group));
  return [...sizes].map((size, i) => [sizeMaterials[i], sizeSets[i], size]);
}

test("measures the length of a whole texture on the surface", () => {
  expect(rowsOf(squareGroup(0.25))).toEqual([
    [7, 0, 4],
    [9, 0, 4],
  ]);
  expect(rowsOf(squareGroup(0)).map(([, , size]) => size)).toEqual([0, 0]);
});

test("measures each set of texture coordinates", () => {
  const group = squareGroup(8);
  group.values.uvs2 = squareGroup(0.5).values.uvs as Float32Array;
  expect(rowsOf(group)).toEqual([
    [7, 0, 0.125],
    [9, 0, 0.125],
    [7, 2, 2],
    [9, 2, 2],
  ]);
});

test("measures all materials of a cluster that mixes them", () => {
  const group = squareGroup(0.25, [7, 7, 7, 7, 9, 9, 9, 3]);
  group.indices.set([4, 5, 6, 7, 7, 7], 6);
  group.values.uvs?.set([0, 0, 1, 0, 1, 1], 8);
  expect(rowsOf(group).map(([material]) => material)).toEqual([7, 3, 9]);
  expect(rowsOf(group).at(-1)).toEqual([9, 0, 2]);
});
