// Decodes the vertices of a cluster: integers, each the sum of a prediction from earlier vertices and
// a residual in a Rice code. The prediction is the parallelogram of Touma and Gotsman ("Triangle Mesh
// Compression", 1998), damped, or a mean. docs/format.md specifies it under "A cluster's data".

import { corrupt } from "../errors.js";
import { MAX_COMPONENTS } from "../format/attributes.js";
import type { BitReader } from "./bit_reader.js";
import type { ComponentRanges } from "./chunk_tables.js";

/** The Rice parameter of a component whose residuals are all zero. */
const ALL_ZERO = 31;
/** In place of a Rice parameter of twins: they are coded as all others are. */
const AS_OTHERS = 32;
const POSITION_COMPONENTS = 3;
/** The Rice parameters of each component, of usual vertices and of those with a twin; scratch. */
const parameters = new Uint8Array(MAX_COMPONENTS);
const twinParameters = new Uint8Array(MAX_COMPONENTS);

/** What earlier vertices of the group tell: for each the one that it is equal to, or -1. */
export interface KnownVertices {
  equal: Int32Array;
  /** The one that has its position, or -1; undefined in version 3 of the format. */
  twin: Int32Array | undefined;
  /** Whether any vertex of the cluster has a twin. */
  anyTwin: boolean;
}

/** Reads the parameters of a cluster and its first vertex; returns the damping. */
function readParameters(
  bits: BitReader,
  ranges: ComponentRanges,
  { equal, twin, anyTwin }: KnownVertices,
  rows: Int32Array,
  first: number,
): number {
  const stride = ranges.bits.length;
  const damping = bits.take(2);
  const same = twin ? twin[first] : -1;
  for (let i = 0; i < stride; ++i) {
    const isStored = twin === undefined || ranges.bits[i] > 0;
    parameters[i] = isStored ? bits.take(5) : ALL_ZERO;
    const hasOwn = anyTwin && i >= POSITION_COMPONENTS && isStored && bits.take(1) === 1;
    twinParameters[i] = hasOwn ? bits.take(5) : AS_OTHERS;
    if (equal[first] >= 0) continue;
    rows[first * stride + i] =
      same >= 0 && i < POSITION_COMPONENTS
        ? rows[same * stride + i]
        : ranges.lowest[i] + bits.take(ranges.bits[i]);
  }
  return damping;
}

/**
 * Writes the rows of a cluster's vertices among those of its group.
 * @param smooth for each component 1 if it is predicted by the mean of two, 0 by a parallelogram
 * @param predictors those of the cluster's TriangleDecoder
 * @param first the cluster's first vertex in the group
 */
export function decodeVertices(
  bits: BitReader,
  smooth: Uint8Array,
  ranges: ComponentRanges,
  predictors: Uint8Array,
  known: KnownVertices,
  rows: Int32Array,
  first: number,
  count: number,
): void {
  const stride = smooth.length;
  const { equal, anyTwin } = known;
  const damping = readParameters(bits, ranges, known, rows, first);
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
    const twin = anyTwin && known.twin ? known.twin[first + v] : -1;
    let i = 0;
    if (twin >= 0) for (; i < POSITION_COMPONENTS; ++i) rows[row + i] = rows[twin * stride + i];
    for (; i < stride; ++i) {
      const isBeside = twin >= 0 && twinParameters[i] !== AS_OTHERS;
      const k = isBeside ? twinParameters[i] : parameters[i];
      const residual = k === ALL_ZERO ? 0 : bits.rice(k);
      let predicted: number;
      if (isBeside) {
        predicted = rows[twin * stride + i];
      } else {
        const sum = rows[a + i] + rows[b + i];
        const far = rows[opposite + i];
        predicted = smooth[i]
          ? Math.floor(sum / 2)
          : sum - far - Math.floor((damping * (sum - 2 * far)) / 16);
      }
      rows[row + i] = predicted + ((residual >>> 1) ^ -(residual & 1));
    }
  }
}
