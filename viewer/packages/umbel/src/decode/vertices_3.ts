// Decodes the vertices of a cluster as version 3 of the format has them: vertex by vertex, all of its
// components. docs/format.md says what is different there.

import { corrupt } from "../errors.js";
import { MAX_COMPONENTS } from "../format/attributes.js";
import type { BitReader } from "./bit_reader.js";
import type { ComponentRanges } from "./chunk_tables.js";
import { ALL_ZERO, predict } from "./vertices.js";

/** The Rice parameters of each component; scratch. */
const parameters = new Uint8Array(MAX_COMPONENTS);

/**
 * Writes the rows of a cluster's vertices among those of its group.
 * @param smooth for each component 1 if it is predicted by the mean of two, 0 by a parallelogram
 * @param predictors those of connectivity.ts
 * @param equal for each vertex of the group the earlier one that it is equal to, or -1
 * @param first the cluster's first vertex in the group
 */
export function decodeVertices3(
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
      const residual = parameters[i] === ALL_ZERO ? 0 : bits.coded(parameters[i], 0);
      const predicted = predict(smooth[i], damping, rows[a + i], rows[b + i], rows[opposite + i]);
      rows[row + i] = predicted + ((residual >>> 1) ^ -(residual & 1));
    }
  }
}
