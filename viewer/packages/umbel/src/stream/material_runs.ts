// Which triangles of a cluster have which material. Most clusters are of one; in an asset that mixes
// materials the triangles of a cluster are put in the order of theirs, so that each is one piece.

import type { GroupGeometry } from "../decode/page.js";

export interface Parts {
  /** For each cluster its first part, and behind the last. */
  partOffsets: Uint32Array;
  partMaterials: Uint32Array;
  /** The first triangle of each part, and behind the last. */
  partTriangles: Uint32Array;
}

export function partsOf({ info, indices, values }: GroupGeometry): Parts {
  if (values.material) return mixedParts(info, indices, values.material);
  return {
    partOffsets: Uint32Array.from({ length: info.clusterCount + 1 }, (_, i) => i),
    partMaterials: info.material.slice(),
    partTriangles: info.triangleOffsets.slice(),
  };
}

/** Moves the triangles of each cluster; `materials` are the vertices'. */
function mixedParts(
  { clusterCount, triangleOffsets }: GroupGeometry["info"],
  indices: Uint32Array,
  materials: Float32Array,
): Parts {
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
    partOffsets: Uint32Array.from(offsets),
    partMaterials: Uint32Array.from(found),
    partTriangles: Uint32Array.from(starts),
  };
}
