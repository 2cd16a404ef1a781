// Decodes the vertices of a cluster: integers, each the sum of a prediction from earlier vertices and
// a residual in a Rice code. The prediction is the parallelogram of Touma and Gotsman ("Triangle Mesh
// Compression", 1998), damped, or a mean. docs/format.md specifies it under "A cluster's data".

import { corrupt } from "../errors.js";
import { MAX_COMPONENTS } from "../format/attributes.js";
import type { BitReader } from "./bit_reader.js";

/** The Rice parameter of a component whose residuals are all zero. */
const ALL_ZERO = 31;
/** The Rice parameter of each component; scratch memory. */
const parameters = new Uint8Array(MAX_COMPONENTS);

/** For each component its least value, and the bits of the first vertex's offset from that. */
export interface ComponentRanges {
  lowest: Int32Array;
  bits: Uint8Array;
}

/**
 * Writes the rows of a cluster's vertices among those of its group.
 * @param smooth for each component 1 if it is predicted by the mean of two, 0 by a parallelogram
 * @param predictors those of the cluster's TriangleDecoder
 * @param equal for each vertex of the group the earlier one that it is equal to, or -1
 * @param first the cluster's first vertex in the group
 */
export function decodeVertices(
  bits: BitReader,
  smooth: Uint8Array,
  ranges: ComponentRanges,
  predictors: Uint8Array,
  equal: Int32Array,
  rows: Int32Array,
  first: number,
  count: number,
): void {
  const stride = smooth.length;
  const damping = bits.take(2);
  for (let i = 0; i < stride; ++i) {
    parameters[i] = bits.take(5);
    if (equal[first] < 0) rows[first * stride + i] = ranges.lowest[i] + bits.take(ranges.bits[i]);
  }
  for (let v = 0; v < count; ++v) {
    const row = (first + v) * stride;
    const same = equal[first + v];
    if (same >= 0) {
      if (same >= first) corrupt("a vertex is shared with a later one");
      for (let i = 0; i < stride; ++i) rows[row + i] = rows[same * stride + i];
      continue;
    }
    if (v === 0) continue;
    const a = (first + predictors[3 * v]) * stride;
    const b = (first + predictors[3 * v + 1]) * stride;
    const opposite = (first + predictors[3 * v + 2]) * stride;
    for (let i = 0; i < stride; ++i) {
      const k = parameters[i];
      const residual = k === ALL_ZERO ? 0 : bits.rice(k);
      const sum = rows[a + i] + rows[b + i];
      const far = rows[opposite + i];
      const predicted = smooth[i]
        ? Math.floor(sum / 2)
        : sum - far - Math.floor((damping * (sum - 2 * far)) / 16);
      rows[row + i] = predicted + ((residual >>> 1) ^ -(residual & 1));
    }
  }
}
