// Finds the ranges of triangles that share a material. Most clusters have one material; where a
// cluster mixes materials, its triangles are sorted by material, so each material is one range.

import type { GroupGeometry } from "../decode/group.js";

export interface MaterialRanges {
  /** First range of each cluster, and the end of the last. */
  rangeOffsets: Uint32Array;
  rangeMaterials: Uint32Array;
  /** First triangle of each range, and the end of the last. */
  rangeTriangles: Uint32Array;
}

export function materialRangesOf({ info, indices, values }: GroupGeometry): MaterialRanges {
  if (values.material) return mixedRanges(info, indices, values.material);
  return {
    rangeOffsets: Uint32Array.from({ length: info.clusterCount + 1 }, (_, i) => i),
    rangeMaterials: info.material.slice(),
    rangeTriangles: info.triangleOffsets.slice(),
  };
}

/** Sorts the triangles of each cluster; `materials` has one number a vertex. */
function mixedRanges(
  { clusterCount, triangleOffsets }: GroupGeometry["info"],
  indices: Uint32Array,
  materials: Float32Array,
): MaterialRanges {
  const offsets = [0];
  const found: number[] = [];
  const starts: number[] = [];
  for (let c = 0; c < clusterCount; ++c) {
    const [first, end] = [triangleOffsets[c], triangleOffsets[c + 1]];
    const triangles = Array.from({ length: end - first }, (_, i) => {
      const corners = indices.slice(3 * (first + i), 3 * (first + i + 1));
      return { corners, material: materials[corners[0]] >>> 0 };
    });
    triangles.sort((a, b) => a.material - b.material);
    triangles.forEach(({ corners, material }, i) => {
      indices.set(corners, 3 * (first + i));
      if (i > 0 && found[found.length - 1] === material) return;
      found.push(material);
      starts.push(first + i);
    });
    offsets.push(found.length);
  }
  starts.push(triangleOffsets[clusterCount]);
  return {
    rangeOffsets: Uint32Array.from(offsets),
    rangeMaterials: Uint32Array.from(found),
    rangeTriangles: Uint32Array.from(starts),
  };
}
