// Lists the edges of clusters, each once, to draw them as lines.

import type { RenderGroup } from "../../pack/render_group.js";
import type { Allocation } from "./arena.js";

const MAX_VERTICES = 256;
const seen = new Uint8Array(MAX_VERTICES * MAX_VERTICES);

/**
 * Writes two vertices an edge into `out`, which has room for three edges a triangle.
 * @returns the first index of each cluster's edges, and the end of the last
 */
export function clusterEdges(
  group: RenderGroup,
  allocation: Allocation,
  out: Uint32Array,
): Uint32Array {
  const { clusterCount, vertexOffsets, triangleOffsets } = group;
  const { indices, vertex } = allocation;
  const offsets = new Uint32Array(clusterCount + 1);
  let at = 2 * allocation.index;
  offsets[0] = at;
  for (let c = 0; c < clusterCount; ++c) {
    const first = vertex + vertexOffsets[c];
    seen.fill(0);
    for (let i = 3 * triangleOffsets[c]; i < 3 * triangleOffsets[c + 1]; i += 3)
      for (let side = 0; side < 3; ++side) {
        const a = indices[i + side];
        const b = indices[i + ((side + 1) % 3)];
        const key = (Math.min(a, b) - first) * MAX_VERTICES + Math.max(a, b) - first;
        if (seen[key]) continue;
        seen[key] = 1;
        out[at++] = a;
        out[at++] = b;
      }
    offsets[c + 1] = at;
  }
  return offsets;
}
