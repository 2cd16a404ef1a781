// The head of an .umbel file: its header and sections, as docs/format.md describes them, checked so
// that nothing after this has to doubt an index.

import { MAX_COMPONENTS } from "../decode/vertices.js";
import { corrupt, UmbelError } from "../errors.js";
import { type Attribute, makeAttribute, smoothComponents, UV_SETS } from "./attributes.js";
import { type Json, jsonOf, uvSetsOf } from "./gltf.js";
import { hasChecksum } from "./xxh64.js";

export const NONE = 0xffffffff;
export const HEADER_SIZE = 128;
const MAJOR = 3;
const MAGIC = [0xab, 0x55, 0x4d, 0x42, 0x4c, 0x0d, 0x0a, 0x1a];

export interface Header {
  minor: number;
  size: number;
  fileBytes: number;
  headBytes: number;
  sections: number;
  maxTriangles: number;
  maxVertices: number;
}

/** What names a group from elsewhere. Groups of all meshes are numbered through. */
export interface Reference {
  group: number;
  page: number;
  /** How many groups have clusters that were made from it. */
  parents: number;
  error: number;
  /** Centre and radius. */
  sphere: readonly [number, number, number, number];
}

export interface MeshEntry {
  sourceTriangles: number;
  sourceVertices: number;
  low: Float32Array;
  high: Float32Array;
  attributes: Attribute[];
  /** For each component: 1 if it is predicted by a mean. */
  smooth: Uint8Array;
  levels: number;
  roots: Reference[];
  /** Of all meshes' groups and clusters, numbered through: the first of this one. */
  firstGroup: number;
  firstCluster: number;
  groups: number;
  clusters: number;
}

export interface Instance {
  mesh: number;
  /** Three rows of four. */
  matrix: Float32Array;
}

export interface Pages {
  count: number;
  offset: Float64Array;
  size: Uint32Array;
  groups: Uint32Array;
  /** Low and high half, two a page. */
  checksum: Uint32Array;
}

export interface EmbeddedFile {
  offset: number;
  size: number;
}

export interface Head {
  header: Header;
  /** What is added to every position, also to those of instances, in binary64. */
  origin: [number, number, number];
  metadata: Json;
  /** glTF's materials, textures, samplers and images. */
  materials: Json;
  /** glTF's nodes, cameras, skins and what else the scene has; empty where the file has none. */
  scene: Json;
  meshes: MeshEntry[];
  instances: Instance[];
  files: EmbeddedFile[];
  pages: Pages;
  groups: number;
  clusters: number;
}

interface Section {
  stride: number;
  offset: number;
  count: number;
}

const NEEDED: Record<string, number> = {
  META: 1,
  MTRL: 1,
  ATTR: 24,
  MESH: 88,
  LEVL: 8,
  ROOT: 32,
  INST: 64,
  FILE: 24,
  PAGE: 24,
  NODE: 32,
};
/** Sections that may be there, once. */
const OPTIONAL: Record<string, number> = { ORIG: 24, SCEN: 1 };
/** What a group takes in its page at least, and a cluster. */
const PAGE_HEADER = 16;
const GROUP_ROW = 64;
const CLUSTER_ROW = 24;
/** What is drawn is kept for every instance of every group, in two bytes. */
const MOST_DRAWN = 2 ** 30;
/** More than any machine that runs a browser could hold the tables of. */
const MOST_GROUPS = 2 ** 26;

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
  };
  if (
    header.sections > 1024 ||
    header.headBytes > header.fileBytes ||
    header.headBytes < size + 40 * header.sections
  )
    corrupt("The file is damaged: its header contradicts itself.");
  return header;
}

/** All but the pages, from the whole head of a file. */
export function readHead(bytes: Uint8Array): Head {
  const header = readHeader(bytes);
  if (bytes.length < header.headBytes) corrupt("The file is cut off in its tables.");
  const head = bytes.subarray(0, header.headBytes);
  const view = viewOf(head);
  if (!hasChecksum(head.subarray(header.size), view, 32))
    corrupt("The file is damaged: the checksum of its tables does not match.");
  const sections = readSections(view, header);
  const at = (name: string) => sections.get(name) as Section;
  const pages = readPages(view, at("PAGE"), header);
  const materials = readJson(head, at("MTRL"));
  const meshes = readMeshes(view, at, pages.count, uvSetsOf(materials));
  const last = meshes[meshes.length - 1];
  const groups = last ? last.firstGroup + last.groups : 0;
  const clusters = last ? last.firstCluster + last.clusters : 0;
  const instances = readInstances(view, at("INST"), meshes.length);
  if (groups * instances.length > MOST_DRAWN)
    throw new UmbelError("unsupported", "The file shows its meshes too often for this viewer.");
  if (pages.groups.reduce((sum, count) => sum + count, 0) !== groups)
    corrupt("The file is damaged: its pages do not hold all groups.");
  if (pages.size.reduce((sum, size) => sum + size, 0) < CLUSTER_ROW * clusters)
    corrupt("The file is damaged: its pages cannot hold all clusters.");
  return {
    header,
    origin: readOrigin(view, sections.get("ORIG")),
    metadata: readJson(head, at("META")),
    materials,
    scene: readJson(head, sections.get("SCEN")),
    meshes,
    instances,
    files: readFiles(view, at("FILE"), header),
    pages,
    groups,
    clusters,
  };
}

function readSections(view: DataView, header: Header): Map<string, Section> {
  const sections = new Map<string, Section>();
  for (let i = 0; i < header.sections; ++i) {
    const row = header.size + 40 * i;
    const name = String.fromCharCode(...[0, 1, 2, 3].map((j) => view.getUint8(row + j)));
    const stride = view.getUint32(row + 4, true);
    const offset = u64(view, row + 8);
    const size = u64(view, row + 16);
    const count = u64(view, row + 24);
    const end = name === "NODE" ? header.fileBytes : header.headBytes;
    const least = NEEDED[name] ?? OPTIONAL[name];
    if (offset + size > end || (least && (stride < least || stride * count !== size)))
      corrupt(`The file is damaged: its section ${name} does not fit.`);
    if (least && sections.has(name)) corrupt(`The file is damaged: it has two sections ${name}.`);
    sections.set(name, { stride, offset, count });
  }
  for (const name of Object.keys(NEEDED))
    if (!sections.has(name)) corrupt(`The file is damaged: it has no section ${name}.`);
  return sections;
}

function rows<T>(view: DataView, { offset, stride, count }: Section, read: (at: number) => T): T[] {
  if (offset + stride * count > view.byteLength) corrupt("The file is damaged.");
  return Array.from({ length: count }, (_, i) => read(offset + i * stride));
}

function readOrigin(view: DataView, section: Section | undefined): [number, number, number] {
  if (!section || section.count === 0) return [0, 0, 0];
  const at = (i: number) => view.getFloat64(section.offset + 8 * i, true);
  const origin: [number, number, number] = [at(0), at(1), at(2)];
  if (section.count > 1 || !origin.every(Number.isFinite))
    corrupt("The file is damaged: its origin is no place.");
  return origin;
}

function readJson(head: Uint8Array, section: Section | undefined): Json {
  if (!section) return {};
  const { offset, count } = section;
  try {
    const text = new TextDecoder("utf-8", { fatal: true }).decode(
      head.subarray(offset, offset + count),
    );
    return jsonOf(JSON.parse(text || "{}"));
  } catch {
    return {}; // geometry can be shown without it
  }
}

/** Sets of texture coordinates that no material uses are left, as attributes of no known name are. */
function readAttributes(view: DataView, section: Section, uvSets: Set<number>): Attribute[] {
  const isLeft = (name: Attribute["name"]) =>
    UV_SETS.some((known, set) => known === name && !uvSets.has(set));
  return rows(view, section, (row) => {
    const attribute = makeAttribute({
      kind: view.getUint32(row, true),
      set: view.getUint32(row + 4, true),
      coding: view.getUint32(row + 8, true),
      components: view.getUint16(row + 12, true),
      isSmooth: view.getUint16(row + 14, true) !== 0,
      bits: view.getUint32(row + 16, true),
      step: view.getFloat32(row + 20, true),
    });
    return isLeft(attribute.name) ? { ...attribute, name: undefined } : attribute;
  });
}

/** Reads a reference; `firstGroup` is that of the mesh. */
export function readReference(view: DataView, at: number, firstGroup: number): Reference {
  const [error, x, y, z, radius] = f32s(view, at + 12, 5);
  return {
    group: firstGroup + view.getUint32(at, true),
    page: view.getUint32(at + 4, true),
    parents: view.getUint32(at + 8, true),
    error: error as number,
    sphere: [x as number, y as number, z as number, radius as number],
  };
}

function readMeshes(
  view: DataView,
  at: (name: string) => Section,
  pages: number,
  uvSets: Set<number>,
): MeshEntry[] {
  const attributes = readAttributes(view, at("ATTR"), uvSets);
  const levels = at("LEVL").count;
  const roots = at("ROOT");
  let firstGroup = 0;
  let firstCluster = 0;
  return rows(view, at("MESH"), (row) => {
    const range = (offset: number, count: number): [number, number] => {
      const first = view.getUint32(row + offset, true);
      const end = first + view.getUint32(row + offset + 4, true);
      if (end > count) corrupt("The file is damaged: a mesh's range lies outside its table.");
      return [first, end];
    };
    const mine = attributes.slice(...range(48, attributes.length));
    const [firstLevel, endLevel] = range(56, levels);
    const [firstRoot, endRoot] = range(64, roots.count);
    const groups = view.getUint32(row + 80, true);
    const clusters = view.getUint32(row + 84, true);
    const mesh: MeshEntry = {
      sourceTriangles: u64(view, row),
      sourceVertices: u64(view, row + 8),
      low: f32s(view, row + 24, 3),
      high: f32s(view, row + 36, 3),
      attributes: mine,
      smooth: smoothComponents(mine),
      levels: endLevel - firstLevel,
      roots: [],
      firstGroup,
      firstCluster,
      groups,
      clusters,
    };
    if (mine[0]?.name !== "positions") corrupt("The file is damaged: a mesh has no positions.");
    if (mesh.smooth.length > MAX_COMPONENTS) corrupt("The file is damaged: too many attributes.");
    for (let i = firstRoot; i < endRoot; ++i)
      mesh.roots.push(readReference(view, roots.offset + i * roots.stride, firstGroup));
    if (mesh.roots.some(({ group, page }) => group - firstGroup >= groups || page >= pages))
      corrupt("The file is damaged: a root is not there.");
    firstGroup += groups;
    firstCluster += clusters;
    if (firstGroup > MOST_GROUPS || firstCluster > 256 * MOST_GROUPS)
      corrupt("The file is damaged: it names an impossible number of groups.");
    return mesh;
  });
}

function readInstances(view: DataView, section: Section, meshes: number): Instance[] {
  const instances = rows(view, section, (row) => ({
    matrix: f32s(view, row, 12),
    mesh: view.getUint32(row + 48, true),
  }));
  if (instances.some(({ mesh, matrix }) => mesh >= meshes || !matrix.every(Number.isFinite)))
    corrupt("The file is damaged: an instance is of no mesh.");
  if (instances.length > 0) return instances;
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
  return Array.from({ length: meshes }, (_, mesh) => ({
    mesh,
    matrix: Float32Array.from(identity),
  }));
}

function readFiles(view: DataView, section: Section, header: Header): EmbeddedFile[] {
  const files = rows(view, section, (row) => ({
    offset: u64(view, row),
    size: u64(view, row + 8),
  }));
  if (files.some(({ offset, size }) => offset + size > header.fileBytes))
    corrupt("The file is damaged: an embedded file does not lie in it.");
  return files;
}

function readPages(view: DataView, section: Section, header: Header): Pages {
  const { count } = section;
  if (section.offset + section.stride * count > view.byteLength) corrupt("The file is damaged.");
  const pages = {
    count,
    offset: new Float64Array(count),
    size: new Uint32Array(count),
    groups: new Uint32Array(count),
    checksum: new Uint32Array(2 * count),
  };
  let end = header.headBytes;
  for (let p = 0; p < count; ++p) {
    const row = section.offset + p * section.stride;
    pages.offset[p] = u64(view, row);
    pages.size[p] = view.getUint32(row + 8, true);
    pages.groups[p] = view.getUint32(row + 12, true);
    pages.checksum[2 * p] = view.getUint32(row + 16, true);
    pages.checksum[2 * p + 1] = view.getUint32(row + 20, true);
    if (pages.offset[p] < end || pages.offset[p] + pages.size[p] > header.fileBytes)
      corrupt(`The file is damaged: page ${p} overlaps another.`);
    if (PAGE_HEADER + GROUP_ROW * pages.groups[p] > pages.size[p])
      corrupt(`The file is damaged: page ${p} cannot hold its groups.`);
    end = pages.offset[p] + pages.size[p];
  }
  return pages;
}
