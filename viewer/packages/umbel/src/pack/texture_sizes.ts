// Measures how far textures are stretched over a group's surface. With the distance of the camera
// this gives the resolution at which a texture is needed.

import type { GroupGeometry } from "../decode/group.js";

export interface TextureSizes {
  /** The materials of the group's clusters, each once. */
  sizeMaterials: Uint32Array;
  /** For each: length on the surface that a whole texture covers, in the mesh's units. */
  sizes: Float32Array;
}

/** Every so many triangles one is measured; a mean needs no more. */
const STEP = 4;

export function textureSizesOf({ info, indices, values }: GroupGeometry): TextureSizes {
  const { positions, uvs } = values;
  if (!positions || !uvs) return { sizeMaterials: new Uint32Array(0), sizes: new Float32Array(0) };
  const areas = new Map<number, { surface: number; texture: number }>();
  for (let c = 0; c < info.clusterCount; ++c) {
    const material = info.material[c];
    let sum = areas.get(material);
    if (!sum) {
      sum = { surface: 0, texture: 0 };
      areas.set(material, sum);
    }
    for (let t = info.triangleOffsets[c]; t < info.triangleOffsets[c + 1]; t += STEP) {
      const [i, j, k] = [indices[3 * t], indices[3 * t + 1], indices[3 * t + 2]];
      sum.surface += surfaceArea(positions, i, j, k);
      sum.texture += textureArea(uvs, i, j, k);
    }
  }
  const sizes = [...areas.values()].map(({ surface, texture }) =>
    // If all vertices share one texture coordinate, the smallest copy suffices.
    texture > 0 ? Math.sqrt(surface / texture) : 0,
  );
  return { sizeMaterials: Uint32Array.from(areas.keys()), sizes: Float32Array.from(sizes) };
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
