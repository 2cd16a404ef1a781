// The tables of the file header: meshes, instances, embedded files and pages.

import { corrupt } from "../errors.js";
import {
  type Attribute,
  MAX_COMPONENTS,
  makeAttribute,
  smoothComponents,
  UV_SETS,
} from "./attributes.js";
import { readFloats, readU64 } from "./binary.js";
import { type FixedHeader, readRows, type Section } from "./sections.js";

/** A reference to a group. Groups of all meshes are numbered through. */
export interface GroupReference {
  group: number;
  page: number;
  /** Number of groups with clusters that were made from it: its parents in the DAG. */
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
  /** For each component: 1 if it is predicted by a mean, 0 by a parallelogram. */
  smooth: Uint8Array;
  levels: number;
  roots: GroupReference[];
  /** Number of the mesh's first group and cluster among those of all meshes. */
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

export interface EmbeddedFile {
  offset: number;
  size: number;
}

/** Bytes of the rows in a page; a page is at least as large as its rows. */
export const PAGE_HEADER = 16;
export const GROUP_ROW = 64;
export const REFERENCE_ROW = 32;
/** More groups than fit into a browser's memory. */
const MAX_GROUPS = 2 ** 26;

/** Reads a reference; `firstGroup` is that of the mesh. */
export function readReference(view: DataView, at: number, firstGroup: number): GroupReference {
  const [error, x, y, z, radius] = readFloats(view, at + 12, 5);
  return {
    group: firstGroup + view.getUint32(at, true),
    page: view.getUint32(at + 4, true),
    parents: view.getUint32(at + 8, true),
    error: error as number,
    sphere: [x as number, y as number, z as number, radius as number],
  };
}

/** Reads all attributes; sets of texture coordinates that no material uses lose their name. */
function readAttributes(view: DataView, section: Section, uvSets: Set<number>): Attribute[] {
  const isUnused = (name: Attribute["name"]) =>
    UV_SETS.some((known, set) => known === name && !uvSets.has(set));
  return readRows(view, section, (row) => {
    const attribute = makeAttribute({
      kind: view.getUint32(row, true),
      set: view.getUint32(row + 4, true),
      coding: view.getUint32(row + 8, true),
      components: view.getUint16(row + 12, true),
      isSmooth: view.getUint16(row + 14, true) !== 0,
      bits: view.getUint32(row + 16, true),
      step: view.getFloat32(row + 20, true),
    });
    return isUnused(attribute.name) ? { ...attribute, name: undefined } : attribute;
  });
}

/** @param uvSets the sets of texture coordinates that materials use */
export function readMeshes(
  view: DataView,
  section: (name: string) => Section,
  pages: number,
  uvSets: Set<number>,
): MeshEntry[] {
  const attributes = readAttributes(view, section("ATTR"), uvSets);
  let firstGroup = 0;
  let firstCluster = 0;
  return readRows(view, section("MESH"), (row) => {
    const mesh = readMesh(view, row, section, attributes, firstGroup, firstCluster);
    if (mesh.roots.some(({ group, page }) => group - firstGroup >= mesh.groups || page >= pages))
      corrupt("The file is damaged: a root is not there.");
    firstGroup += mesh.groups;
    firstCluster += mesh.clusters;
    if (firstGroup > MAX_GROUPS || firstCluster > 256 * MAX_GROUPS)
      corrupt("The file is damaged: it names an impossible number of groups.");
    return mesh;
  });
}

function readMesh(
  view: DataView,
  row: number,
  section: (name: string) => Section,
  attributes: readonly Attribute[],
  firstGroup: number,
  firstCluster: number,
): MeshEntry {
  const roots = section("ROOT");
  const range = (offset: number, count: number): [number, number] => {
    const first = view.getUint32(row + offset, true);
    const end = first + view.getUint32(row + offset + 4, true);
    if (end > count) corrupt("The file is damaged: a mesh's range lies outside its table.");
    return [first, end];
  };
  const own = attributes.slice(...range(48, attributes.length));
  const [firstLevel, endLevel] = range(56, section("LEVL").count);
  const [firstRoot, endRoot] = range(64, roots.count);
  const smooth = smoothComponents(own);
  if (own[0]?.name !== "positions") corrupt("The file is damaged: a mesh has no positions.");
  if (smooth.length > MAX_COMPONENTS) corrupt("The file is damaged: too many attributes.");
  return {
    sourceTriangles: readU64(view, row),
    sourceVertices: readU64(view, row + 8),
    low: readFloats(view, row + 24, 3),
    high: readFloats(view, row + 36, 3),
    attributes: own,
    smooth,
    levels: endLevel - firstLevel,
    roots: Array.from({ length: endRoot - firstRoot }, (_, i) =>
      readReference(view, roots.offset + (firstRoot + i) * roots.stride, firstGroup),
    ),
    firstGroup,
    firstCluster,
    groups: view.getUint32(row + 80, true),
    clusters: view.getUint32(row + 84, true),
  };
}

/** The instances of a file; one of each mesh where the file lists none. */
export function readInstances(view: DataView, section: Section, meshes: number): Instance[] {
  const instances = readRows(view, section, (row) => ({
    matrix: readFloats(view, row, 12),
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

export function readFiles(view: DataView, section: Section, fixed: FixedHeader): EmbeddedFile[] {
  const files = readRows(view, section, (row) => ({
    offset: readU64(view, row),
    size: readU64(view, row + 8),
  }));
  if (files.some(({ offset, size }) => offset + size > fixed.fileBytes))
    corrupt("The file is damaged: an embedded file does not lie in it.");
  return files;
}
