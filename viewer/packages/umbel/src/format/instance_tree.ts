// The tree of instances of an asset with very many: its nodes, and the pages of placements.

import { corrupt } from "../errors.js";
import { readFloats, readU64 } from "./binary.js";
import type { Section } from "./sections.js";
import { xxh64 } from "./xxh64.js";

const PAGE_HEADER = 16;
const PLACEMENT = 52;
/** Numbers of a placement: three rows of four. */
export const ROWS = 12;
/** More nodes than fit into a browser's memory. */
const MAX_NODES = 2 ** 24;

/** Where the tree lies in the file. */
export interface InstanceTables {
  nodes: Section;
  pages: Section;
  /** For each mesh: the largest error of its groups that are no roots. */
  coarsestErrors: Float32Array;
}

/** The nodes, breadth first; arrays have an element a node. */
export interface InstanceNodes {
  count: number;
  /** Centre and radius, four a node. */
  spheres: Float32Array;
  /** Of the stand-ins. */
  error: Float32Array;
  /** Largest error that a placement of the page has with its mesh's coarsest clusters. */
  coarsestError: Float32Array;
  firstChild: Uint32Array;
  children: Uint32Array;
  /** In the page of the parent; those of the root are the header's instances. */
  firstStandIn: Uint32Array;
  standIns: Uint32Array;
  /** Where its page lies in the file. */
  offset: Float64Array;
  size: Uint32Array;
  /** Placements in its page, and instances below it. */
  placements: Uint32Array;
  instances: Uint32Array;
  /** Of its page: low and high half, two a node. */
  checksum: Uint32Array;
}

/** Placements of a page. */
export interface Placements {
  count: number;
  /** Three rows of four each. */
  rows: Float32Array;
  mesh: Uint32Array;
}

export function readInstanceTables(
  view: DataView,
  sections: ReadonlyMap<string, Section>,
  meshes: number,
): InstanceTables | undefined {
  const [nodes, pages, errors] = ["ITRE", "IPAG", "IERR"].map((name) => sections.get(name));
  if (!nodes || nodes.count === 0) return undefined;
  if (!pages || !errors || errors.count !== meshes || nodes.count > MAX_NODES)
    corrupt("The file is damaged: its tree of instances is not whole.");
  const coarsestErrors = Float32Array.from(
    { length: meshes },
    (_, i) => readFloats(view, errors.offset + i * errors.stride, 1)[0] as number,
  );
  if (!coarsestErrors.every(isSize))
    corrupt("The file is damaged: a mesh's coarsest error is no number.");
  return { nodes, pages, coarsestErrors };
}

/** @param listed the number of instances in the header */
export function readInstanceNodes(
  bytes: Uint8Array,
  { nodes: section, pages }: InstanceTables,
  listed: number,
): InstanceNodes {
  const { count, stride } = section;
  const [high, low] = xxh64(bytes);
  if (
    bytes.length !== count * stride ||
    section.checksum?.[0] !== low ||
    section.checksum[1] !== high
  )
    corrupt("The file is damaged: the checksum of its tree of instances does not match.");
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  const column = (at: number) =>
    Uint32Array.from({ length: count }, (_, n) => view.getUint32(n * stride + at, true));
  const floats = (at: number, width: number) =>
    Float32Array.from({ length: width * count }, (_, i) =>
      view.getFloat32(Math.floor(i / width) * stride + at + 4 * (i % width), true),
    );
  const size = column(48);
  const nodes: InstanceNodes = {
    count,
    spheres: floats(0, 4),
    error: floats(16, 1),
    coarsestError: floats(20, 1),
    firstChild: column(24),
    children: column(28),
    firstStandIn: column(32),
    standIns: column(36),
    offset: Float64Array.from({ length: count }, (_, n) => readU64(view, n * stride + 40)),
    size,
    placements: size.map((bytes) => (bytes - PAGE_HEADER) / PLACEMENT),
    instances: column(52),
    checksum: Uint32Array.from({ length: 2 * count }, (_, i) =>
      view.getUint32((i >> 1) * stride + 56 + 4 * (i & 1), true),
    ),
  };
  for (let n = 0; n < count; ++n) {
    checkValues(nodes, n, pages.count * pages.stride);
    (nodes.offset[n] as number) += pages.offset;
  }
  checkStructure(nodes, listed);
  return nodes;
}

function isSize(value: number): boolean {
  return Number.isFinite(value) && value >= 0;
}

function wrongNode(n: number): never {
  corrupt(`The file is damaged: node ${n} of its instances contradicts itself.`);
}

function checkValues(nodes: InstanceNodes, n: number, pageBytes: number): void {
  const sphere = nodes.spheres.subarray(4 * n, 4 * n + 4);
  const size = nodes.size[n] as number;
  const isRight =
    sphere.every(Number.isFinite) &&
    isSize(sphere[3] as number) &&
    isSize(nodes.error[n] as number) &&
    isSize(nodes.coarsestError[n] as number) &&
    size >= PAGE_HEADER &&
    (size - PAGE_HEADER) % PLACEMENT === 0 &&
    (nodes.offset[n] as number) + size <= pageBytes;
  if (!isRight) wrongNode(n);
}

/** Nodes follow each other level by level, and a page has the stand-ins of all children in turn. */
function checkStructure(nodes: InstanceNodes, listed: number): void {
  const { count, children, firstChild, firstStandIn, standIns, placements, instances, error } =
    nodes;
  let next = 1;
  if (firstStandIn[0] !== 0 || standIns[0] !== listed) wrongNode(0);
  for (let n = 0; n < count; ++n) {
    if (children[n] === 0) {
      if (instances[n] !== placements[n]) wrongNode(n);
      continue;
    }
    const end = next + children[n];
    if (firstChild[n] !== next || end > count) wrongNode(n);
    let shown = 0;
    let below = 0;
    for (; next < end; ++next) {
      if (firstStandIn[next] !== shown || !(error[next] <= error[n])) wrongNode(n);
      shown += standIns[next];
      below += instances[next];
    }
    if (shown !== placements[n] || below !== instances[n]) wrongNode(n);
  }
  if (next !== count) wrongNode(next);
}

/** Reads the page of a node. */
export function readPlacements(
  bytes: Uint8Array,
  nodes: InstanceNodes,
  node: number,
  meshes: number,
): Placements {
  const count = nodes.placements[node] as number;
  const [high, low] = xxh64(bytes);
  if (
    bytes.length !== nodes.size[node] ||
    nodes.checksum[2 * node] !== low ||
    nodes.checksum[2 * node + 1] !== high
  )
    corrupt(`The placements of node ${node} of the file are damaged.`);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  const rows = new Float32Array(ROWS * count);
  const mesh = new Uint32Array(count);
  if (view.getUint32(0, true) !== node || view.getUint32(4, true) !== count) wrongNode(node);
  for (let i = 0; i < count; ++i) {
    const at = PAGE_HEADER + PLACEMENT * i;
    for (let j = 0; j < ROWS; ++j) rows[ROWS * i + j] = view.getFloat32(at + 4 * j, true);
    mesh[i] = view.getUint32(at + 4 * ROWS, true);
  }
  if (!rows.every(Number.isFinite) || mesh.some((m) => m >= meshes)) wrongNode(node);
  return { count, rows, mesh };
}
