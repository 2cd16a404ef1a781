// The vertices of a cluster: integers, each a prediction from vertices before it and a remainder
// in a Rice code, as docs/format.md describes it under "A cluster's data".

import type { BitReader } from "./bits.js";

const ALL_ZERO = 31;
const MAX_COMPONENTS = 16;

const parameters = new Uint8Array(MAX_COMPONENTS);

export interface ComponentRanges {
  lowest: Int32Array;
  bits: Uint8Array;
}

/**
 * Writes `count` rows of integers to `out` from `at` on.
 * @param smooth for each component 1 if it is predicted by the mean of two, 0 by a parallelogram
 * @param parents as a TriangleDecoder left them
 */
export function decodeVertices(
  bits: BitReader,
  smooth: Uint8Array,
  ranges: ComponentRanges,
  parents: Uint8Array,
  count: number,
  out: Int32Array,
  at: number,
): void {
  const stride = smooth.length;
  for (let i = 0; i < stride; ++i) {
    parameters[i] = bits.take(5);
    out[at + i] = ranges.lowest[i] + bits.take(ranges.bits[i]);
  }
  for (let v = 1; v < count; ++v) {
    const a = at + parents[3 * v] * stride;
    const b = at + parents[3 * v + 1] * stride;
    const across = at + parents[3 * v + 2] * stride;
    const row = at + v * stride;
    for (let i = 0; i < stride; ++i) {
      const k = parameters[i];
      const r = k === ALL_ZERO ? 0 : bits.rice(k);
      const remainder = (r >>> 1) ^ -(r & 1);
      const predicted = smooth[i]
        ? Math.floor((out[a + i] + out[b + i]) / 2)
        : out[a + i] + out[b + i] - out[across + i];
      out[row + i] = predicted + remainder;
    }
  }
}
