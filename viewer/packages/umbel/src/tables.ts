// The head of an .umbel file: its header and tables, as docs/format.md describes them, checked so
// that nothing after this has to doubt an index.

import { type Attribute, makeAttribute, smoothComponents } from "./attributes.js";
import { corrupt, UmbelError } from "./errors.js";
import { hasChecksum } from "./xxh64.js";

export const NONE = 0xffffffff;
export const HEADER_SIZE = 128;
const MAJOR = 2;
const MAGIC = [0xab, 0x55, 0x4d, 0x42, 0x4c, 0x0d, 0x0a, 0x1a];

export interface Header {
  minor: number;
  size: number;
  fileBytes: number;
  headBytes: number;
  sections: number;
  maxTriangles: number;
  maxVertices: number;
  sourceTriangles: number;
  sourceVertices: number;
  low: Float32Array;
  high: Float32Array;
}

export interface Groups {
  count: number;
  firstCluster: Uint32Array;
  clusterCount: Uint32Array;
  level: Uint32Array;
  rung: Uint32Array;
  /** Centre and radius, four a group. */
  sphere: Float32Array;
  error: Float32Array;
  /** Of the group's page. */
  page: Uint32Array;
}

export interface Clusters {
  count: number;
  /** The group that was simplified to make it, or NONE. */
  generating: Uint32Array;
  material: Uint32Array;
  vertices: Uint16Array;
  triangles: Uint16Array;
  /** Lowest and highest corner, six a cluster. */
  box: Float32Array;
}

export interface Nodes {
  count: number;
  sphere: Float32Array;
  error: Float32Array;
  group: Uint32Array;
  firstChild: Uint32Array;
  childCount: Uint32Array;
}

export interface Pages {
  count: number;
  offset: Float64Array;
  size: Float64Array;
  /** Low and high half, two a page. */
  checksum: Uint32Array;
  group: Uint32Array;
}

export interface Tables {
  header: Header;
  metadata: Record<string, unknown>;
  attributes: Attribute[];
  smooth: Uint8Array;
  levels: { first: number; count: number }[];
  groups: Groups;
  clusters: Clusters;
  nodes: Nodes;
  pages: Pages;
}

interface Section {
  stride: number;
  offset: number;
  count: number;
}

const NEEDED: Record<string, number> = {
  META: 1,
  ATTR: 16,
  LEVL: 8,
  GRUP: 36,
  CLUS: 24,
  NODE: 32,
  PAGE: 32,
};

function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** A u64, which no file that fits anywhere needs more than 53 bits of. */
function u64(view: DataView, at: number): number {
  const value = view.getUint32(at + 4, true) * 0x100000000 + view.getUint32(at, true);
  if (!Number.isSafeInteger(value)) corrupt("The file is damaged: it names an impossible size.");
  return value;
}

function f32s(view: DataView, at: number, count: number): Float32Array {
  return Float32Array.from({ length: count }, (_, i) => view.getFloat32(at + 4 * i, true));
}

/** The header, from the first bytes of a file: HEADER_SIZE of them or more. */
export function readHeader(bytes: Uint8Array): Header {
  if (bytes.length < 16 || MAGIC.some((byte, i) => bytes[i] !== byte))
    throw new UmbelError("not-umbel", "This is not an .umbel file.");
  const view = viewOf(bytes);
  const major = view.getUint16(8, true);
  if (major !== MAJOR)
    throw new UmbelError(
      "version",
      `The file has format version ${major}; this viewer reads version ${MAJOR}.`,
    );
  const size = view.getUint32(12, true);
  if (size < HEADER_SIZE || size > 4096 || size % 8 !== 0)
    corrupt("The file is damaged: its header has an impossible size.");
  if (bytes.length < size) corrupt("The file is cut off in its header.");
  if (!hasChecksum(bytes.subarray(0, size - 8), view, size - 8))
    corrupt("The file is damaged: its header's checksum does not match.");
  const header = {
    minor: view.getUint16(10, true),
    size,
    fileBytes: u64(view, 16),
    headBytes: u64(view, 24),
    sections: view.getUint32(40, true),
    maxTriangles: view.getUint32(48, true),
    maxVertices: view.getUint32(52, true),
    sourceTriangles: u64(view, 56),
    sourceVertices: u64(view, 64),
    low: f32s(view, 80, 3),
    high: f32s(view, 92, 3),
  };
  if (
    header.sections > 1024 ||
    header.headBytes > header.fileBytes ||
    header.headBytes < size + 32 * header.sections
  )
    corrupt("The file is damaged: its header contradicts itself.");
  return header;
}

/** The tables, from the whole head of a file. */
export function readTables(head: Uint8Array): Tables {
  const header = readHeader(head);
  if (head.length < header.headBytes) corrupt("The file is cut off in its tables.");
  const view = viewOf(head.subarray(0, header.headBytes));
  if (!hasChecksum(head.subarray(header.size, header.headBytes), view, 32))
    corrupt("The file is damaged: the checksum of its tables does not match.");
  const sections = readSections(view, header);
  const at = (name: string) => sections.get(name) as Section;
  const attributes = readAttributes(view, at("ATTR"));
  const tables = {
    header,
    metadata: readMetadata(head, at("META")),
    attributes,
    smooth: smoothComponents(attributes),
    levels: rows(view, at("LEVL"), (row) => ({
      first: view.getUint32(row, true),
      count: view.getUint32(row + 4, true),
    })),
    groups: readGroups(view, at("GRUP")),
    clusters: readClusters(view, at("CLUS"), header),
    nodes: readNodes(view, at("NODE")),
    pages: readPages(view, at("PAGE")),
  };
  check(tables);
  return tables;
}

function readSections(view: DataView, header: Header): Map<string, Section> {
  const sections = new Map<string, Section>();
  for (let i = 0; i < header.sections; ++i) {
    const row = header.size + 32 * i;
    const name = String.fromCharCode(...[0, 1, 2, 3].map((j) => view.getUint8(row + j)));
    const stride = view.getUint32(row + 4, true);
    const offset = u64(view, row + 8);
    const size = u64(view, row + 16);
    const count = u64(view, row + 24);
    const least = NEEDED[name];
    if (offset + size > header.headBytes || (least && (stride < least || stride * count !== size)))
      corrupt(`The file is damaged: its table ${name} does not fit.`);
    if (least && sections.has(name)) corrupt(`The file is damaged: it has two tables ${name}.`);
    sections.set(name, { stride, offset, count });
  }
  for (const name of Object.keys(NEEDED))
    if (!sections.has(name)) corrupt(`The file is damaged: it has no table ${name}.`);
  return sections;
}

function rows<T>(view: DataView, { offset, stride, count }: Section, read: (at: number) => T): T[] {
  if (offset + stride * count > view.byteLength) corrupt("The file is damaged.");
  return Array.from({ length: count }, (_, i) => read(offset + i * stride));
}

function readMetadata(head: Uint8Array, { offset, count }: Section): Record<string, unknown> {
  try {
    const text = new TextDecoder("utf-8", { fatal: true }).decode(
      head.subarray(offset, offset + count),
    );
    const value: unknown = JSON.parse(text || "{}");
    return typeof value === "object" && value !== null ? (value as Record<string, unknown>) : {};
  } catch {
    return {}; // nothing in it is needed
  }
}

function readAttributes(view: DataView, section: Section): Attribute[] {
  const attributes = rows(view, section, (row) =>
    makeAttribute(
      view.getUint32(row, true),
      view.getUint32(row + 4, true),
      view.getUint32(row + 8, true),
      view.getFloat32(row + 12, true),
    ),
  );
  if (attributes[0]?.name !== "positions") corrupt("The file is damaged: it has no positions.");
  if (new Set(attributes.map((a) => a.name)).size !== attributes.length)
    corrupt("The file is damaged: it has an attribute twice.");
  return attributes;
}

function readGroups(view: DataView, { offset, stride, count }: Section): Groups {
  const groups = {
    count,
    firstCluster: new Uint32Array(count),
    clusterCount: new Uint32Array(count),
    level: new Uint32Array(count),
    rung: new Uint32Array(count),
    sphere: new Float32Array(4 * count),
    error: new Float32Array(count),
    page: new Uint32Array(count).fill(NONE),
  };
  for (let g = 0; g < count; ++g) {
    const row = offset + g * stride;
    groups.firstCluster[g] = view.getUint32(row, true);
    groups.clusterCount[g] = view.getUint32(row + 4, true);
    groups.level[g] = view.getUint32(row + 8, true);
    groups.rung[g] = view.getUint32(row + 12, true);
    for (let i = 0; i < 4; ++i) groups.sphere[4 * g + i] = view.getFloat32(row + 16 + 4 * i, true);
    groups.error[g] = view.getFloat32(row + 32, true);
  }
  return groups;
}

function readClusters(
  view: DataView,
  { offset, stride, count }: Section,
  { low, high }: Header,
): Clusters {
  const clusters = {
    count,
    generating: new Uint32Array(count),
    material: new Uint32Array(count),
    vertices: new Uint16Array(count),
    triangles: new Uint16Array(count),
    box: new Float32Array(6 * count),
  };
  for (let c = 0; c < count; ++c) {
    const row = offset + c * stride;
    clusters.generating[c] = view.getUint32(row, true);
    clusters.material[c] = view.getUint32(row + 4, true);
    clusters.vertices[c] = view.getUint16(row + 8, true);
    clusters.triangles[c] = view.getUint16(row + 10, true);
    for (let i = 0; i < 6; ++i) {
      const axis = i % 3;
      const q = view.getUint16(row + 12 + 2 * i, true);
      clusters.box[6 * c + i] = low[axis] + (high[axis] - low[axis]) * (q / 65535);
    }
  }
  return clusters;
}

function readNodes(view: DataView, { offset, stride, count }: Section): Nodes {
  const nodes = {
    count,
    sphere: new Float32Array(4 * count),
    error: new Float32Array(count),
    group: new Uint32Array(count),
    firstChild: new Uint32Array(count),
    childCount: new Uint32Array(count),
  };
  for (let n = 0; n < count; ++n) {
    const row = offset + n * stride;
    for (let i = 0; i < 4; ++i) nodes.sphere[4 * n + i] = view.getFloat32(row + 4 * i, true);
    nodes.error[n] = view.getFloat32(row + 16, true);
    nodes.group[n] = view.getUint32(row + 20, true);
    nodes.firstChild[n] = view.getUint32(row + 24, true);
    nodes.childCount[n] = view.getUint32(row + 28, true);
  }
  return nodes;
}

function readPages(view: DataView, { offset, stride, count }: Section): Pages {
  const pages = {
    count,
    offset: new Float64Array(count),
    size: new Float64Array(count),
    checksum: new Uint32Array(2 * count),
    group: new Uint32Array(count),
  };
  for (let p = 0; p < count; ++p) {
    const row = offset + p * stride;
    pages.offset[p] = u64(view, row);
    pages.size[p] = u64(view, row + 8);
    pages.checksum[2 * p] = view.getUint32(row + 16, true);
    pages.checksum[2 * p + 1] = view.getUint32(row + 20, true);
    pages.group[p] = view.getUint32(row + 24, true);
  }
  return pages;
}

function check({ header, groups, clusters, nodes, pages }: Tables): void {
  const wrong = (what: string): never => corrupt(`The file is damaged: ${what}.`);
  let next = 0;
  for (let g = 0; g < groups.count; ++g) {
    if (groups.firstCluster[g] !== next) wrong(`group ${g} does not follow the one before`);
    next += groups.clusterCount[g];
  }
  if (next !== clusters.count) wrong("some clusters are in no group");
  for (let g = 0; g < groups.count; ++g)
    for (let c = groups.firstCluster[g]; c < groups.firstCluster[g] + groups.clusterCount[g]; ++c) {
      const generating = clusters.generating[c];
      if (generating === NONE) continue;
      if (generating >= groups.count || groups.level[generating] >= groups.level[g])
        wrong(`cluster ${c} is made from no finer group`);
    }
  checkNodes(nodes, groups.count);
  let end = header.headBytes;
  for (let p = 0; p < pages.count; ++p) {
    if (pages.offset[p] < end || pages.offset[p] + pages.size[p] > header.fileBytes)
      wrong(`page ${p} overlaps another`);
    end = pages.offset[p] + pages.size[p];
    const group = pages.group[p];
    if (group >= groups.count || groups.page[group] !== NONE) wrong(`page ${p} has no group`);
    groups.page[group] = p;
  }
  if (pages.count !== groups.count) wrong("some groups have no page");
}

function checkNodes(nodes: Nodes, groups: number): void {
  const hasParent = new Uint8Array(nodes.count);
  let leaves = 0;
  for (let n = 0; n < nodes.count; ++n) {
    const first = nodes.firstChild[n];
    const count = nodes.childCount[n];
    const isLeaf = nodes.group[n] !== NONE;
    if (isLeaf ? nodes.group[n] >= groups || count !== 0 : first + count > nodes.count)
      corrupt(`The file is damaged: node ${n} points outside.`);
    if (isLeaf) ++leaves;
    else
      for (let i = first; i < first + count; ++i) {
        if (i === 0 || hasParent[i]++) corrupt(`The file is damaged: node ${i} has two parents.`);
      }
  }
  // With one parent at most and as many reached from the root as there are, it is a tree.
  let reached = 0;
  const stack = nodes.count ? [0] : [];
  for (let n = stack.pop(); n !== undefined; n = stack.pop()) {
    ++reached;
    for (let i = 0; i < nodes.childCount[n]; ++i) stack.push(nodes.firstChild[n] + i);
  }
  if (reached !== nodes.count || leaves !== groups)
    corrupt("The file is damaged: its hierarchy is not a tree over its groups.");
}
