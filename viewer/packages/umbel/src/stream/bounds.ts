// The bounding box of an asset: of all its instances.

import type { AssetInfo } from "./asset_info.js";

type Point = [number, number, number];

export interface Bounds {
  low: Point;
  high: Point;
}

/** The box of all instances; from -1 to 1 if there are none. */
export function boundsOf({ meshes, instances }: Pick<AssetInfo, "meshes" | "instances">): Bounds {
  const low: Point = [Infinity, Infinity, Infinity];
  const high: Point = [-Infinity, -Infinity, -Infinity];
  for (const { mesh, matrix: m } of instances) {
    const box = meshes[mesh];
    if (!box || box.low[0] > box.high[0]) continue;
    for (let axis = 0; axis < 3; ++axis) {
      let middle = m[4 * axis + 3] as number;
      let half = 0;
      for (let i = 0; i < 3; ++i) {
        const factor = m[4 * axis + i] as number;
        middle += factor * 0.5 * (box.low[i] + box.high[i]);
        half += Math.abs(factor) * 0.5 * (box.high[i] - box.low[i]);
      }
      low[axis] = Math.min(low[axis] as number, middle - half);
      high[axis] = Math.max(high[axis] as number, middle + half);
    }
  }
  return low[0] <= high[0] ? { low, high } : { low: [-1, -1, -1], high: [1, 1, 1] };
}
