// The file header of an .umbel file: everything before the first page, as docs/format.md describes
// it. All indices are checked here, so later code trusts them.

import { leastClusterBytes } from "../decode/chunk_tables.js";
import { corrupt, UmbelError } from "../errors.js";
import { viewOf } from "./binary.js";
import { type Json, uvSetsOf } from "./gltf.js";
import { type InstanceTables, readInstanceTables } from "./instance_tree.js";
import { emptyPageTable, type PageTable, readPages } from "./page_table.js";
import {
  type FixedHeader,
  OPENING,
  readFixedHeader,
  readJson,
  readSections,
  type Section,
} from "./sections.js";
import { checksumsOf } from "./table_slices.js";
import {
  type EmbeddedFile,
  type Instance,
  type MeshEntry,
  readFiles,
  readInstances,
  readMeshes,
} from "./tables.js";
import { hasChecksum } from "./xxh64.js";

/** No group, or no page. */
export const NONE = 0xffffffff;

export interface FileHeader {
  fixed: FixedHeader;
  /** Offset of all positions, instances' included, in binary64. */
  origin: [number, number, number];
  metadata: Json;
  /** glTF's materials, textures, samplers and images. */
  materials: Json;
  /** glTF's nodes, cameras, skins and extensions of the scene; empty where the file has none. */
  scene: Json;
  meshes: MeshEntry[];
  /** Those in `INST`: with a tree of instances, the stand-ins of its root. */
  instances: Instance[];
  /** Where the tree of instances lies, if there is one. */
  tree: InstanceTables | undefined;
  files: EmbeddedFile[];
  pages: PageTable;
  groups: number;
  clusters: number;
}

/** Selection keeps two bytes for every known group of every instance. */
const MAX_INSTANCED_GROUPS = 2 ** 30;

/** Bytes that `readFileHeader` needs at least. */
export function openingBytesOf({ openingBytes, headerBytes }: FixedHeader): number {
  return openingBytes || headerBytes;
}

/**
 * Reads the file header from the bytes before the first page. Where its table of pages can be read
 * in slices, the bytes before that table suffice; `readSlice` then reads slices of it.
 */
export function readFileHeader(bytes: Uint8Array): FileHeader {
  const fixed = readFixedHeader(bytes);
  const isOpening = fixed.openingBytes > 0 && bytes.length < fixed.headerBytes;
  const size = isOpening ? openingBytesOf(fixed) : fixed.headerBytes;
  if (bytes.length < size) corrupt("The file is cut off in its tables.");
  const header = bytes.subarray(0, size);
  const view = viewOf(header);
  if (!hasChecksum(header.subarray(fixed.size), view, isOpening ? OPENING + 8 : 32))
    corrupt("The file is damaged: the checksum of its tables does not match.");
  const sections = readSections(view, fixed);
  const section = (name: string) => sections.get(name) as Section;
  const pages = isOpening
    ? openPages(view, section("PAGE"), sections.get("PSUM"), fixed)
    : readPages(view, section("PAGE"), sections.get("PSUM"), fixed);
  const materials = readJson(header, section("MTRL"));
  const meshes = readMeshes(view, section, pages.count, uvSetsOf(materials));
  const last = meshes[meshes.length - 1];
  const groups = last ? last.firstGroup + last.groups : 0;
  const clusters = last ? last.firstCluster + last.clusters : 0;
  const instances = readInstances(view, section("INST"), meshes.length);
  if (groups * instances.length > MAX_INSTANCED_GROUPS)
    throw new UmbelError("unsupported", "The file has too many instances for this viewer.");
  if (!isOpening) checkPages(pages, groups, leastClusterBytes(fixed.major) * clusters);
  return {
    fixed,
    origin: readOrigin(view, sections.get("ORIG")),
    metadata: readJson(header, section("META")),
    materials,
    scene: readJson(header, sections.get("SCEN")),
    meshes,
    instances,
    tree: readInstanceTables(view, sections, meshes.length),
    files: readFiles(view, section("FILE"), fixed),
    pages,
    groups,
    clusters,
  };
}

/** The table of pages that is read in slices: it is the first after the bytes that were read. */
function openPages(
  view: DataView,
  section: Section,
  sums: Section | undefined,
  fixed: FixedHeader,
): PageTable {
  if (section.offset !== fixed.openingBytes)
    corrupt("The file is damaged: its table of pages is not where its header says.");
  const checksums = checksumsOf(view, section, sums);
  if (!checksums && section.count > 0)
    corrupt("The file is damaged: its table of pages has no checksums.");
  return emptyPageTable(section, checksums);
}

/** Checks a whole table of pages. */
function checkPages(pages: PageTable, groups: number, clusterBytes: number): void {
  if (pages.groups.reduce((sum, count) => sum + count, 0) !== groups)
    corrupt("The file is damaged: its pages do not hold all groups.");
  if (pages.size.reduce((sum, size) => sum + size, 0) < clusterBytes)
    corrupt("The file is damaged: its pages cannot hold all clusters.");
}

function readOrigin(view: DataView, section: Section | undefined): [number, number, number] {
  if (!section || section.count === 0) return [0, 0, 0];
  const at = (i: number) => view.getFloat64(section.offset + 8 * i, true);
  const origin: [number, number, number] = [at(0), at(1), at(2)];
  if (section.count > 1 || !origin.every(Number.isFinite))
    corrupt("The file is damaged: its origin is not finite.");
  return origin;
}
