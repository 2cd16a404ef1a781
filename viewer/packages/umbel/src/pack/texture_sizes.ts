// Measures how far textures are stretched over a group's surface. With the distance of the camera
// this gives the resolution at which a texture is needed.

import type { GroupGeometry } from "../decode/group.js";
import { UV_SETS } from "../format/attributes.js";
import type { MaterialRanges } from "./material_ranges.js";

export interface TextureSizes {
  /** A material of the group's triangles and a set of texture coordinates: each pair once. */
  sizeMaterials: Uint32Array;
  sizeSets: Uint8Array;
  /** For each: length on the surface that a whole texture covers, in the mesh's units. */
  sizes: Float32Array;
}

/** Every so many triangles of a range one is measured; a mean needs no more. */
const STEP = 4;

/** @param ranges of the triangles, whose indices are in the order of the ranges */
export function textureSizesOf(
  { indices, values }: Pick<GroupGeometry, "indices" | "values">,
  { rangeMaterials, rangeTriangles }: MaterialRanges,
): TextureSizes {
  const { positions } = values;
  const rows: { material: number; set: number; size: number }[] = [];
  UV_SETS.forEach((name, set) => {
    const uvs = values[name];
    if (!positions || !uvs) return;
    const areas = new Map<number, { surface: number; texture: number }>();
    rangeMaterials.forEach((material, range) => {
      let sum = areas.get(material);
      if (!sum) {
        sum = { surface: 0, texture: 0 };
        areas.set(material, sum);
      }
      for (let t = rangeTriangles[range]; t < rangeTriangles[range + 1]; t += STEP) {
        const [i, j, k] = [indices[3 * t], indices[3 * t + 1], indices[3 * t + 2]];
        sum.surface += surfaceArea(positions, i, j, k);
        sum.texture += textureArea(uvs, i, j, k);
      }
    });
    // If all vertices share one texture coordinate, the smallest copy suffices.
    for (const [material, { surface, texture }] of areas)
      rows.push({ material, set, size: texture > 0 ? Math.sqrt(surface / texture) : 0 });
  });
  return {
    sizeMaterials: Uint32Array.from(rows, ({ material }) => material),
    sizeSets: Uint8Array.from(rows, ({ set }) => set),
    sizes: Float32Array.from(rows, ({ size }) => size),
  };
}

/** Twice the area of a triangle on the surface. */
function surfaceArea(p: Float32Array, i: number, j: number, k: number): number {
  const ax = p[3 * j] - p[3 * i];
  const ay = p[3 * j + 1] - p[3 * i + 1];
  const az = p[3 * j + 2] - p[3 * i + 2];
  const bx = p[3 * k] - p[3 * i];
  const by = p[3 * k + 1] - p[3 * i + 1];
  const bz = p[3 * k + 2] - p[3 * i + 2];
  const x = ay * bz - az * by;
  const y = az * bx - ax * bz;
  const z = ax * by - ay * bx;
  return Math.sqrt(x * x + y * y + z * z);
}

/** Twice the area of a triangle in texture space. */
function textureArea(uvs: Float32Array, i: number, j: number, k: number): number {
  const u = uvs[2 * i];
  const v = uvs[2 * i + 1];
  const across = (uvs[2 * j] - u) * (uvs[2 * k + 1] - v);
  return Math.abs(across - (uvs[2 * j + 1] - v) * (uvs[2 * k] - u));
}
