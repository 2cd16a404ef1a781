// Turns the integers of vertices into floats, by the codings of docs/format.md, `ATTR`.

import { type Attribute, type AttributeName, WIDTHS } from "../format/attributes.js";

/** Floats of each attribute, for all vertices of a group. */
export type Values = Partial<Record<AttributeName, Float32Array>>;

/** One attribute's integers of `count` vertices: rows of `stride`, from column `at`. */
interface Column {
  rows: Int32Array;
  stride: number;
  at: number;
  count: number;
}

/** Floats whose bits are ordered as integers. */
function floats({ rows, stride, at, count }: Column, width: number): Float32Array {
  const words = new Int32Array(count * width);
  for (let v = 0; v < count; ++v)
    for (let i = 0; i < width; ++i) {
      const word = rows[v * stride + at + i];
      words[v * width + i] = word < 0 ? word ^ 0x7fffffff : word;
    }
  return new Float32Array(words.buffer);
}

/** Multiples of a grid step. */
function gridValues(
  { rows, stride, at, count }: Column,
  width: number,
  step: number,
): Float32Array {
  const values = new Float32Array(count * width);
  for (let v = 0; v < count; ++v)
    for (let i = 0; i < width; ++i) values[v * width + i] = rows[v * stride + at + i] * step;
  return values;
}

/** Where a mesh's octahedral normals are among its columns. */
interface NormalColumn {
  at: number;
  bits: number;
}

/** Whether the integers of an octahedral vector are those of one that points down. */
function pointsDown(i0: number, i1: number, m: number): boolean {
  return Math.abs(i0) + Math.abs(i1) > m;
}

/**
 * The unit vectors of octahedral integers, before they are rounded to floats.
 * See Meyer et al., "On floating-point normal vectors" (2010).
 */
function unitVectors({ rows, stride, count }: Column, { at, bits }: NormalColumn): Float64Array {
  const m = 2 ** (bits - 1) - 1;
  const vectors = new Float64Array(3 * count);
  for (let v = 0; v < count; ++v) {
    let x = rows[v * stride + at] / m;
    let y = rows[v * stride + at + 1] / m;
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) {
      x += x < 0 ? -z : z;
      y += y < 0 ? -z : z;
    }
    const length = Math.sqrt(x * x + y * y + z * z);
    vectors[3 * v] = x / length;
    vectors[3 * v + 1] = y / length;
    vectors[3 * v + 2] = z / length;
  }
  return vectors;
}

/** Cosines and sines of the angles of as many bits, by turns; made when first asked for. */
const anglesOfBits: (Float64Array | undefined)[] = [];
const MOST_TABLE_BITS = 12;

function angles(bits: number): Float64Array | undefined {
  if (bits > MOST_TABLE_BITS) return undefined;
  let table = anglesOfBits[bits];
  if (table === undefined) {
    table = new Float64Array(2 << bits);
    for (let i = 0; i < 1 << bits; ++i) {
      const angle = (2 * Math.PI * i) / 2 ** bits;
      table[2 * i] = Math.cos(angle);
      table[2 * i + 1] = Math.sin(angle);
    }
    anglesOfBits[bits] = table;
  }
  return table;
}

/**
 * Each tangent is an angle in the plane of its normal. The plane's basis follows Duff et al.,
 * "Building an orthonormal basis, revisited" (2017).
 */
function tangents(
  { rows, stride, at, count }: Column,
  bits: number,
  normal: NormalColumn,
  normals: Float64Array,
): Float32Array {
  const m = 2 ** (normal.bits - 1) - 1;
  const table = angles(bits);
  const values = new Float32Array(4 * count);
  for (let v = 0; v < count; ++v) {
    const row = v * stride;
    const x = normals[3 * v];
    const y = normals[3 * v + 1];
    const z = normals[3 * v + 2];
    const g = pointsDown(rows[row + normal.at], rows[row + normal.at + 1], m) ? -1 : 1;
    const p = -1 / (g + z);
    const q = x * y * p;
    const i0 = rows[row + at];
    const isListed = table !== undefined && i0 >>> bits === 0;
    const angle = (2 * Math.PI * i0) / 2 ** bits;
    const cos = isListed ? table[2 * i0] : Math.cos(angle);
    const sin = isListed ? table[2 * i0 + 1] : Math.sin(angle);
    values[4 * v] = (1 + g * x * x * p) * cos + q * sin;
    values[4 * v + 1] = g * q * cos + (g + y * y * p) * sin;
    values[4 * v + 2] = -g * x * cos - y * sin;
    values[4 * v + 3] = rows[row + at + 1] !== 0 ? -1 : 1;
  }
  return values;
}

/** Linear values of the sRGB ones of as many bits; made when first asked for. */
const linearOfBits: (Float64Array | undefined)[] = [];

function linear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}
function linears(bits: number): Float64Array | undefined {
  if (bits > MOST_TABLE_BITS) return undefined;
  linearOfBits[bits] ??= Float64Array.from({ length: 1 << bits }, (_, i) =>
    linear(i / (2 ** bits - 1)),
  );
  return linearOfBits[bits];
}

/** Linear colours from sRGB; alpha stays as it is. */
function colors({ rows, stride, at, count }: Column, bits: number): Float32Array {
  const max = 2 ** bits - 1;
  const table = linears(bits);
  const values = new Float32Array(4 * count);
  for (let v = 0; v < count; ++v) {
    const row = v * stride + at;
    for (let i = 0; i < 3; ++i) {
      const s = rows[row + i];
      values[4 * v + i] = table !== undefined && s >>> bits === 0 ? table[s] : linear(s / max);
    }
    values[4 * v + 3] = rows[row + 3] / max;
  }
  return values;
}

/** Decodes `count` vertices; their integers are rows, `stride` apart. */
export function decodeValues(
  attributes: readonly Attribute[],
  rows: Int32Array,
  stride: number,
  count: number,
): Values {
  const values: Values = {};
  let at = 0;
  let normal: NormalColumn = { at: 0, bits: 2 };
  let units: Float64Array | undefined;
  for (const { name, coding, bits, step, components } of attributes) {
    const column = { rows, stride, at, count };
    if (name === "normals") {
      normal = { at, bits };
      units = undefined;
    }
    if (name === undefined) {
      // This attribute is skipped.
    } else if (coding === 0) values[name] = floats(column, WIDTHS[name]);
    else if (coding === 1) values[name] = gridValues(column, WIDTHS[name], step);
    else if (coding === 2) {
      units = unitVectors(column, { at, bits });
      values[name] = new Float32Array(units);
    } else if (coding === 3) {
      units ??= unitVectors(column, normal);
      values[name] = tangents(column, bits, normal, units);
    } else values[name] = colors(column, bits);
    at += components;
  }
  return values;
}
