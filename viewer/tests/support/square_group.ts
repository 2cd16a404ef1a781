// A small group for tests of materials and textures.

import type { GroupGeometry } from "../../packages/umbel/src/decode/group.js";

/** Two clusters of two triangles each, on a square of two by two. */
export function squareGroup(uvScale: number, materials?: number[]): GroupGeometry {
  const corners = [0, 0, 2, 0, 2, 2, 0, 2];
  const positions = new Float32Array(24);
  const uvs = new Float32Array(16);
  for (let v = 0; v < 8; ++v) {
    positions.set([corners[2 * (v % 4)], corners[2 * (v % 4) + 1], 5], 3 * v);
    uvs.set([uvScale * corners[2 * (v % 4)], uvScale * corners[2 * (v % 4) + 1]], 2 * v);
  }
  return {
    info: {
      clusterCount: 2,
      vertexOffsets: Uint32Array.of(0, 4, 8),
      triangleOffsets: Uint32Array.of(0, 2, 4),
      material: Uint32Array.of(7, 9),
    },
    indices: Uint32Array.of(0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7),
    values: { positions, uvs, ...(materials && { material: Float32Array.from(materials) }) },
  } as unknown as GroupGeometry;
}
