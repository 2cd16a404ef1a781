// What a vertex has, and how its integers become values: the codings of docs/format.md, `ATTR`.

import { corrupt, UmbelError } from "../errors.js";

export type AttributeName =
  | "positions"
  | "normals"
  | "tangents"
  | "uvs"
  | "uvs1"
  | "uvs2"
  | "uvs3"
  | "colors"
  | "material";

export interface AttributeRow {
  kind: number;
  set: number;
  coding: number;
  /** Integers of a vertex. */
  components: number;
  isSmooth: boolean;
  bits: number;
  step: number;
}

export interface Attribute extends AttributeRow {
  /** Undefined for what this reader does not know: its integers are decoded and left. */
  name: AttributeName | undefined;
}

export type Values = Partial<Record<AttributeName, Float32Array>>;

const NAMES = new Map<number, AttributeName>([
  [0, "positions"],
  [1, "normals"],
  [2, "tangents"],
  [4, "uvs"],
  [8, "colors"],
  [64, "material"],
]);
const TEXTURE_COORDINATE = 4;
/** Sets of texture coordinates by their number. */
export const UV_SETS = ["uvs", "uvs1", "uvs2", "uvs3"] as const;
/** Floats of a vertex, once decoded. */
const WIDTHS: Record<AttributeName, number> = {
  positions: 3,
  normals: 3,
  tangents: 4,
  uvs: 2,
  uvs1: 2,
  uvs2: 2,
  uvs3: 2,
  colors: 4,
  material: 1,
};
const CODINGS: Record<AttributeName, readonly number[]> = {
  positions: [0, 1],
  normals: [0, 2],
  tangents: [0, 3],
  uvs: [0, 1],
  uvs1: [0, 1],
  uvs2: [0, 1],
  uvs3: [0, 1],
  colors: [0, 4],
  material: [0, 1],
};

function nameOf({ kind, set }: AttributeRow): AttributeName | undefined {
  if (kind === TEXTURE_COORDINATE) return UV_SETS[set];
  return set === 0 ? NAMES.get(kind) : undefined;
}

export function makeAttribute(row: AttributeRow): Attribute {
  const name = nameOf(row);
  const isKnown = name !== undefined && CODINGS[name].includes(row.coding);
  if (isKnown) {
    const components = row.coding === 2 || row.coding === 3 ? 2 : WIDTHS[name];
    if (row.components !== components || (row.coding >= 2 && (row.bits < 2 || row.bits > 16)))
      corrupt(`The file is damaged: its ${name} have an impossible coding.`);
  } else if (row.kind === 0 && row.set === 0)
    throw new UmbelError("version", "The file codes positions in a way that is not known here.");
  return { ...row, name: isKnown ? name : undefined };
}

/** For each component: 1 if it is predicted by a mean. */
export function smoothComponents(attributes: readonly Attribute[]): Uint8Array {
  return Uint8Array.from(
    attributes.flatMap((a) => Array<number>(a.components).fill(a.isSmooth ? 1 : 0)),
  );
}

/** The integers of one attribute of `count` vertices: rows of `stride`, from column `at`. */
interface Column {
  rows: Int32Array;
  stride: number;
  at: number;
  count: number;
}

function floats({ rows, stride, at, count }: Column, width: number): Float32Array {
  const words = new Int32Array(count * width);
  for (let v = 0; v < count; ++v)
    for (let i = 0; i < width; ++i) {
      const word = rows[v * stride + at + i];
      words[v * width + i] = word < 0 ? word ^ 0x7fffffff : word;
    }
  return new Float32Array(words.buffer);
}

function steps({ rows, stride, at, count }: Column, width: number, step: number): Float32Array {
  const values = new Float32Array(count * width);
  for (let v = 0; v < count; ++v)
    for (let i = 0; i < width; ++i) values[v * width + i] = rows[v * stride + at + i] * step;
  return values;
}

/** Writes the unit vector of two octahedral integers; returns whether it points down. */
function octahedron(i0: number, i1: number, m: number, out: Float64Array): boolean {
  let x = i0 / m;
  let y = i1 / m;
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) {
    x += x < 0 ? -z : z;
    y += y < 0 ? -z : z;
  }
  const length = Math.sqrt(x * x + y * y + z * z);
  out[0] = x / length;
  out[1] = y / length;
  out[2] = z / length;
  return Math.abs(i0) + Math.abs(i1) > m;
}

const normal = new Float64Array(3);

function normals({ rows, stride, at, count }: Column, bits: number): Float32Array {
  const m = 2 ** (bits - 1) - 1;
  const values = new Float32Array(3 * count);
  for (let v = 0; v < count; ++v) {
    octahedron(rows[v * stride + at], rows[v * stride + at + 1], m, normal);
    values.set(normal, 3 * v);
  }
  return values;
}

function tangents(
  column: Column,
  bits: number,
  normalAt: number,
  normalBits: number,
): Float32Array {
  const { rows, stride, at, count } = column;
  const m = 2 ** (normalBits - 1) - 1;
  const values = new Float32Array(4 * count);
  for (let v = 0; v < count; ++v) {
    const row = v * stride;
    const below = octahedron(rows[row + normalAt], rows[row + normalAt + 1], m, normal);
    const [x, y, z] = normal;
    const g = below ? -1 : 1;
    const p = -1 / (g + z);
    const q = x * y * p;
    const angle = (2 * Math.PI * rows[row + at]) / 2 ** bits;
    const cos = Math.cos(angle);
    const sin = Math.sin(angle);
    values[4 * v] = (1 + g * x * x * p) * cos + q * sin;
    values[4 * v + 1] = g * q * cos + (g + y * y * p) * sin;
    values[4 * v + 2] = -g * x * cos - y * sin;
    values[4 * v + 3] = rows[row + at + 1] !== 0 ? -1 : 1;
  }
  return values;
}

function colors({ rows, stride, at, count }: Column, bits: number): Float32Array {
  const most = 2 ** bits - 1;
  const values = new Float32Array(4 * count);
  for (let v = 0; v < count; ++v)
    for (let i = 0; i < 4; ++i) {
      const s = rows[v * stride + at + i] / most;
      const linear = s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
      values[4 * v + i] = i < 3 ? linear : s;
    }
  return values;
}

/** The values of `count` vertices whose integers are rows one after the other. */
export function decodeValues(
  attributes: readonly Attribute[],
  rows: Int32Array,
  count: number,
): Values {
  const stride = attributes.reduce((sum, a) => sum + a.components, 0);
  const values: Values = {};
  let at = 0;
  let normalAt = 0;
  let normalBits = 2;
  for (const { name, coding, bits, step, components } of attributes) {
    const column = { rows, stride, at, count };
    if (name === "normals") {
      normalAt = at;
      normalBits = bits;
    }
    if (name === undefined) {
      // It is left.
    } else if (coding === 0) values[name] = floats(column, WIDTHS[name]);
    else if (coding === 1) values[name] = steps(column, WIDTHS[name], step);
    else if (coding === 2) values[name] = normals(column, bits);
    else if (coding === 3) values[name] = tangents(column, bits, normalAt, normalBits);
    else values[name] = colors(column, bits);
    at += components;
  }
  return values;
}
