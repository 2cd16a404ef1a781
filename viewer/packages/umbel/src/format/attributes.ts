// The attributes of vertices: names, and how each is coded (docs/format.md, `ATTR`).

import { corrupt, UmbelError } from "../errors.js";

/** Integers of a vertex, at most. */
export const MAX_COMPONENTS = 64;

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
  /** Undefined where this reader does not know or need it: it decodes the integers and skips them. */
  name: AttributeName | undefined;
}

const NAMES = new Map<number, AttributeName>([
  [0, "positions"],
  [1, "normals"],
  [2, "tangents"],
  [4, "uvs"],
  [8, "colors"],
  [64, "material"],
]);
/** The kind of texture coordinates, in any set. */
export const TEXTURE_COORDINATE = 4;
/** Names of the sets of texture coordinates, by their number. */
export const UV_SETS = ["uvs", "uvs1", "uvs2", "uvs3"] as const;
/** Floats of a vertex, once decoded. */
export const WIDTHS: Record<AttributeName, number> = {
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
/** The codings that each may have: 0 float, 1 grid, 2 octahedral, 3 angle, 4 sRGB. */
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
    throw new UmbelError(
      "version",
      "The file codes positions in a way that this viewer does not know.",
    );
  return { ...row, name: isKnown ? name : undefined };
}

/** For each component: 1 if it is predicted by a mean, 0 by a parallelogram. */
export function smoothComponents(attributes: readonly Attribute[]): Uint8Array {
  return Uint8Array.from(
    attributes.flatMap((a) => Array<number>(a.components).fill(a.isSmooth ? 1 : 0)),
  );
}
