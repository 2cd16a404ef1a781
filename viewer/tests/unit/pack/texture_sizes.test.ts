import { expect, test } from "vitest";
import { textureSizesOf } from "../../../packages/umbel/src/pack/texture_sizes.js";
import { squareGroup } from "../../support/square_group.js";

test("measures the length of a whole texture on the surface", () => {
  const { sizeMaterials, sizes } = textureSizesOf(squareGroup(0.25));
  expect([...sizeMaterials]).toEqual([7, 9]);
  expect([...sizes]).toEqual([4, 4]);
  expect([...textureSizesOf(squareGroup(0)).sizes]).toEqual([0, 0]);
});
