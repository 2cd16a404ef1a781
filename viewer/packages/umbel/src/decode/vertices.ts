// Decodes the vertices of a cluster: integers, each the sum of a prediction from earlier vertices and
// a residual in a code of its own, attribute by attribute. The prediction is the parallelogram of Touma and
// Gotsman ("Triangle Mesh Compression", 1998), damped, or a mean, or of normals the triangles'.
// docs/format.md specifies it under "A cluster's data".

import { corrupt } from "../errors.js";
import { type Attribute, MAX_COMPONENTS, TEXTURE_COORDINATE } from "../format/attributes.js";
import type { BitReader } from "./bit_reader.js";
import type { ComponentRanges } from "./chunk_tables.js";
import { folded, isLower, predictNormals, us, vs } from "./normal_prediction.js";
import { mapUvs, prediction, predictUv } from "./uv_prediction.js";

/** In place of a parameter: the component's residuals are all zero. */
export const ALL_ZERO = 31;
/** What a vertex's twin tells of an attribute: nothing, all values, or what a bit says. */
const NOTHING = 0;
const ALL = 1;
const FLAGS = 2;
/** The largest number that is small. */
const MOST_SMALL = 2 ** 26;
/** The codes of each component, of usual vertices and of those that start a region: a parameter and
 * a kind from KIND_AT on. */
const KIND_AT = 5;
const usual = new Uint8Array(MAX_COMPONENTS);
const starts = new Uint8Array(MAX_COMPONENTS);
/** The vertices of the cluster that are not shared, and how many there are. */
const own = new Uint8Array(256);
let owned = 0;

/** A component's value, predicted from those of three vertices. */
export function predict(
  isSmooth: boolean | number,
  damping: number,
  a: number,
  b: number,
  across: number,
): number {
  const sum = a + b;
  return isSmooth
    ? Math.floor(sum / 2)
    : sum - across - Math.floor((damping * (sum - 2 * across)) / 16);
}

/** Reads a code. Those of exponential Golomb codes have parameters below 16. */
function readCode(bits: BitReader, hasKinds: boolean): number {
  const k = bits.take(5);
  if (!hasKinds || k === ALL_ZERO) return k;
  const kind = bits.take(2);
  if ((kind & 1) === 1 && k > 15) corrupt(`an exponential code has the parameter ${k}`);
  return k | (kind << KIND_AT);
}

function residual(bits: BitReader, code: number): number {
  const r = code === ALL_ZERO ? 0 : bits.coded(code & ALL_ZERO, code >> KIND_AT);
  return (r >>> 1) ^ -(r & 1);
}

/** The cluster whose vertices are read, among those of its group. */
export interface ClusterRows {
  rows: Int32Array;
  stride: number;
  /** Its first vertex, and how many it has. */
  first: number;
  count: number;
  /** The group's triangles; the cluster's are those from `at` to `end`. */
  indices: Uint32Array;
  at: number;
  end: number;
  /** For each vertex of the cluster, the three that predict it. */
  predictors: Uint8Array;
  /** Whether it is the last of a region's first triangle: 0 or 1. */
  closes: Uint8Array;
  /** For each vertex of the group the earlier one that it is equal to, or -1. */
  equal: Int32Array;
  /** The one that has its position, or -1, and whether any vertex of the cluster has one. */
  twin: Int32Array;
  anyTwin: boolean;
  /** Of the file format. */
  version: number;
}

/** Writes the rows of a cluster's vertices. */
export function decodeVertices(
  bits: BitReader,
  attributes: readonly Attribute[],
  ranges: ComponentRanges,
  cluster: ClusterRows,
): void {
  const { rows, stride, first, count, equal } = cluster;
  owned = 0;
  for (let v = 0; v < count; ++v) {
    const same = equal[first + v];
    if (same >= first) corrupt("a vertex is shared with a later one");
    if (same < 0) own[owned++] = v;
    else for (let i = 0; i < stride; ++i) rows[(first + v) * stride + i] = rows[same * stride + i];
  }
  const damping = bits.take(2);
  let at = 0;
  for (const attribute of attributes) {
    decodeAttribute(bits, attribute, at, ranges, cluster, damping);
    at += attribute.components;
  }
}

function areConstant(ranges: ComponentRanges, at: number, end: number): boolean {
  for (let i = at; i < end; ++i) if (ranges.bits[i] > 0) return false;
  return true;
}

function fillLowest(at: number, end: number, ranges: ComponentRanges, cluster: ClusterRows): void {
  const { rows, stride, first } = cluster;
  for (let i = at; i < end; ++i) {
    const lowest = ranges.lowest[i];
    for (let n = 0; n < owned; ++n) rows[(first + own[n]) * stride + i] = lowest;
  }
}

/** Whether sums of a few values fit into 32 bits, and texture coordinates can be predicted by
 * positions. */
function areSmall(ranges: ComponentRanges, at: number, end: number): boolean {
  for (let i = at; i < end; ++i) {
    const lowest = ranges.lowest[i];
    const width = ranges.bits[i];
    if (width > 27 || lowest < -MOST_SMALL || lowest + (1 << width) > MOST_SMALL) return false;
  }
  return true;
}

/** Whether positions may predict an attribute: texture coordinates on a grid, none of them large. */
function mayBeMapped(attribute: Attribute, at: number, ranges: ComponentRanges): boolean {
  if (attribute.kind !== TEXTURE_COORDINATE || attribute.coding !== 1) return false;
  if (attribute.components !== 2 || attribute.isSmooth) return false;
  return areSmall(ranges, at, at + 2);
}

function readTwinRule(bits: BitReader, at: number, anyTwin: boolean): number {
  if (!anyTwin) return NOTHING;
  if (at === 0) return ALL;
  if (bits.bit() === 0) return NOTHING;
  return bits.bit() === 1 ? ALL : FLAGS;
}

function decodeAttribute(
  bits: BitReader,
  attribute: Attribute,
  at: number,
  ranges: ComponentRanges,
  cluster: ClusterRows,
  damping: number,
): void {
  const { isSmooth } = attribute;
  const end = at + attribute.components;
  if (areConstant(ranges, at, end)) {
    fillLowest(at, end, ranges, cluster);
    return;
  }
  const rule = readTwinRule(bits, at, cluster.anyTwin);
  const isOctahedral = attribute.name === "normals" && attribute.coding === 2;
  const isGeometric = isOctahedral && bits.bit() === 1;
  const steps = 2 ** (attribute.bits - 1) - 1;
  if (isGeometric) {
    const { rows, stride, first, count, indices, at: from, end: to } = cluster;
    predictNormals(rows, stride, indices, from, to, first, count, bits.take(4), steps);
  }
  const isMapped = cluster.version > 5 && mayBeMapped(attribute, at, ranges) && bits.bit() === 1;
  const isMirrored = isMapped && bits.bit() === 1;
  if (isMapped) mapUvs(cluster);
  const hasStarts = !isGeometric && bits.bit() === 1;
  const hasKinds = cluster.version > 4 && bits.bit() === 1;
  for (let i = at; i < end; ++i) {
    const isCoded = isGeometric || ranges.bits[i] > 0;
    usual[i] = isCoded ? readCode(bits, hasKinds) : ALL_ZERO;
    starts[i] = isCoded && hasStarts ? readCode(bits, hasKinds) : usual[i];
  }
  if (isGeometric) decodeGeometric(bits, cluster, at, rule, steps);
  else if (isMapped) decodeMapped(bits, cluster, ranges, at, rule, isMirrored);
  else decodePredicted(bits, cluster, ranges, at, end, rule, isSmooth, damping);
}

/** The vertex that has a vertex's values, or -1, by its twin and what the twin tells. */
function sameAs(bits: BitReader, rule: number, twin: number): number {
  return twin >= 0 && (rule === ALL || (rule === FLAGS && bits.bit() === 1)) ? twin : -1;
}

function copyValues(rows: Int32Array, to: number, from: number, components: number): void {
  for (let i = 0; i < components; ++i) rows[to + i] = rows[from + i];
}

/** The values of the cluster's first vertex, which nothing predicts. */
function readFirst(
  bits: BitReader,
  ranges: ComponentRanges,
  rows: Int32Array,
  row: number,
  at: number,
  end: number,
): void {
  for (let i = at; i < end; ++i) rows[row + i] = ranges.lowest[i] + bits.take(ranges.bits[i]);
}

function decodeGeometric(
  bits: BitReader,
  { rows, stride, first, twin }: ClusterRows,
  at: number,
  rule: number,
  steps: number,
): void {
  const code = usual[at];
  const second = usual[at + 1];
  for (let n = 0; n < owned; ++n) {
    const vertex = own[n];
    const row = (first + vertex) * stride + at;
    const same = sameAs(bits, rule, twin[first + vertex]);
    if (same >= 0) {
      copyValues(rows, row, same * stride + at, 2);
      continue;
    }
    const x = (us[vertex] + residual(bits, code)) | 0;
    const y = (vs[vertex] + residual(bits, second)) | 0;
    rows[row] = isLower[vertex] ? folded(x, y, steps) : x;
    rows[row + 1] = isLower[vertex] ? folded(y, x, steps) : y;
  }
}

function decodeMapped(
  bits: BitReader,
  cluster: ClusterRows,
  ranges: ComponentRanges,
  at: number,
  rule: number,
  isMirrored: boolean,
): void {
  const { rows, stride, first, twin, predictors } = cluster;
  for (let n = 0; n < owned; ++n) {
    const v = own[n];
    const row = (first + v) * stride;
    const same = sameAs(bits, rule, twin[first + v]);
    if (same >= 0) copyValues(rows, row + at, same * stride + at, 2);
    else if (v === 0) readFirst(bits, ranges, rows, row, at, at + 2);
    else {
      const codes = predictors[3 * v] === predictors[3 * v + 1] ? starts : usual;
      predictUv(cluster, v, at, isMirrored);
      rows[row + at] = prediction.u + residual(bits, codes[at]);
      rows[row + at + 1] = prediction.v + residual(bits, codes[at + 1]);
    }
  }
}

function decodePredicted(
  bits: BitReader,
  { rows, stride, first, twin, predictors }: ClusterRows,
  ranges: ComponentRanges,
  at: number,
  end: number,
  rule: number,
  isSmooth: boolean,
  damping: number,
): void {
  const isSmall = areSmall(ranges, at, end);
  for (let n = 0; n < owned; ++n) {
    const v = own[n];
    const row = (first + v) * stride;
    const same = sameAs(bits, rule, twin[first + v]);
    if (same >= 0) {
      copyValues(rows, row + at, same * stride + at, end - at);
      continue;
    }
    if (v === 0) {
      readFirst(bits, ranges, rows, row, at, end);
      continue;
    }
    const a = (first + predictors[3 * v]) * stride;
    const b = (first + predictors[3 * v + 1]) * stride;
    const across = (first + predictors[3 * v + 2]) * stride;
    const codes = a === b ? starts : usual;
    if (isSmall) {
      for (let i = at; i < end; ++i) {
        const sum = (rows[a + i] + rows[b + i]) | 0;
        const opposite = rows[across + i];
        const predicted = isSmooth
          ? sum >> 1
          : (sum - opposite - (Math.imul(damping, (sum - 2 * opposite) | 0) >> 4)) | 0;
        rows[row + i] = (predicted + residual(bits, codes[i])) | 0;
      }
    } else {
      for (let i = at; i < end; ++i)
        rows[row + i] =
          predict(isSmooth, damping, rows[a + i], rows[b + i], rows[across + i]) +
          residual(bits, codes[i]);
    }
  }
}
