import type { MeshPhysicalMaterial } from "three";
import { expect, test, vi } from "vitest";
import { makeMaterial } from "../../../../packages/umbel/src/three/materials/material_maker.js";

// As three.js was before r187.
vi.mock("three", async (original) => {
  const three = await original<typeof import("three")>();
  class Old extends three.MeshPhysicalMaterial {
    constructor() {
      super();
      const range = { value: [100, 400], writable: true };
      Object.defineProperty(this, "iridescenceThicknessRange", range);
      Object.assign(this, { iridescenceThicknessMinimum: undefined });
      Object.assign(this, { iridescenceThicknessMaximum: undefined });
    }
  }
  return { ...three, MeshPhysicalMaterial: Old };
});

test("iridescence has its thicknesses, also with an older three.js", () => {
  const rangeOf = (extensions: object) => {
    const layout = { normals: true, tangents: true, uvs: [true], colors: false };
    const material = makeMaterial({ extensions }, layout, () => {});
    return (material as MeshPhysicalMaterial).iridescenceThicknessRange;
  };
  const thicknesses = { iridescenceThicknessMinimum: 50, iridescenceThicknessMaximum: 900 };
  expect(rangeOf({ KHR_materials_iridescence: thicknesses })).toEqual([50, 900]);
  expect(rangeOf({ KHR_materials_ior: {} })).toEqual([100, 400]);
});
