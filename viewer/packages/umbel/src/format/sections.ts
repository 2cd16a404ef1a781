// The fixed-size header at the start of a file, and the table of sections after it.

import { corrupt, UmbelError } from "../errors.js";
import { readU64, viewOf } from "./binary.js";
import { type Json, jsonOf } from "./gltf.js";
import { hasChecksum } from "./xxh64.js";

export const FIXED_HEADER_SIZE = 128;
/** Versions that are read. */
const OLDEST = 3;
const NEWEST = 6;
const MAGIC = [0xab, 0x55, 0x4d, 0x42, 0x4c, 0x0d, 0x0a, 0x1a];
const SECTION_ROW = 40;
/** Of the opening size in the fixed header; its checksum follows. */
export const OPENING = 56;
const MAX_SECTIONS = 1024;

/** The values of the fixed header. */
export interface FixedHeader {
  major: number;
  minor: number;
  size: number;
  fileBytes: number;
  /** Bytes of the whole file header: this one, the table of sections and the sections. */
  headerBytes: number;
  sections: number;
  /** Where the table of pages starts if it can be read in slices; else 0. */
  openingBytes: number;
  maxTriangles: number;
  maxVertices: number;
}

/** Where a section lies in the file; its rows are `stride` bytes each. */
export interface Section {
  stride: number;
  offset: number;
  count: number;
  /** Low and high half. */
  checksum?: readonly [number, number];
}

/** Sections that every file has, with the least stride of each. */
const REQUIRED: Record<string, number> = {
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
const OPTIONAL: Record<string, number> = {
  ORIG: 24,
  SCEN: 1,
  PSUM: 8,
  NSUM: 8,
  ITRE: 64,
  IPAG: 1,
  IERR: 4,
};
/** Sections after the pages. */
const AFTER_PAGES = new Set(["NODE", "ITRE", "IPAG"]);

/** Reads the fixed header from the first bytes of a file: FIXED_HEADER_SIZE of them or more. */
export function readFixedHeader(bytes: Uint8Array): FixedHeader {
  if (bytes.length < 16 || MAGIC.some((byte, i) => bytes[i] !== byte))
    throw new UmbelError("not-umbel", "This is not an .umbel file.");
  const view = viewOf(bytes);
  const major = view.getUint16(8, true);
  if (major < OLDEST || major > NEWEST)
    throw new UmbelError(
      "version",
      `The file has format version ${major}; this viewer reads ${OLDEST} to ${NEWEST}.`,
    );
  const size = view.getUint32(12, true);
  if (size < FIXED_HEADER_SIZE || size > 4096 || size % 8 !== 0)
    corrupt("The file is damaged: its header has an impossible size.");
  if (bytes.length < size) corrupt("The file is cut off in its header.");
  if (!hasChecksum(bytes.subarray(0, size - 8), view, size - 8))
    corrupt("The file is damaged: its header's checksum does not match.");
  const fixed = {
    major,
    minor: view.getUint16(10, true),
    size,
    fileBytes: readU64(view, 16),
    headerBytes: readU64(view, 24),
    sections: view.getUint32(40, true),
    openingBytes: size > OPENING + 16 ? readU64(view, OPENING) : 0,
    maxTriangles: view.getUint32(48, true),
    maxVertices: view.getUint32(52, true),
  };
  if (
    fixed.sections > MAX_SECTIONS ||
    fixed.headerBytes > fixed.fileBytes ||
    fixed.headerBytes < size + SECTION_ROW * fixed.sections ||
    fixed.openingBytes > fixed.headerBytes ||
    (fixed.openingBytes > 0 && fixed.openingBytes < size + SECTION_ROW * fixed.sections)
  )
    corrupt("The file is damaged: its header contradicts itself.");
  return fixed;
}

/** Reads the table of sections and checks that each one lies where it must. */
export function readSections(view: DataView, fixed: FixedHeader): Map<string, Section> {
  const sections = new Map<string, Section>();
  for (let i = 0; i < fixed.sections; ++i) {
    const row = fixed.size + SECTION_ROW * i;
    const name = String.fromCharCode(...[0, 1, 2, 3].map((j) => view.getUint8(row + j)));
    const stride = view.getUint32(row + 4, true);
    const offset = readU64(view, row + 8);
    const size = readU64(view, row + 16);
    const count = readU64(view, row + 24);
    const minStride = REQUIRED[name] ?? OPTIONAL[name];
    // Sections that this reader does not know may lie anywhere.
    const isInHeader = minStride !== undefined && !AFTER_PAGES.has(name);
    const tablesEnd = (name !== "PAGE" && fixed.openingBytes) || fixed.headerBytes;
    const end = isInHeader ? tablesEnd : fixed.fileBytes;
    if (offset + size > end || (minStride && (stride < minStride || stride * count !== size)))
      corrupt(`The file is damaged: its section ${name} does not fit.`);
    if (minStride && sections.has(name))
      corrupt(`The file is damaged: it has two sections ${name}.`);
    const checksum = [view.getUint32(row + 32, true), view.getUint32(row + 36, true)] as const;
    sections.set(name, { stride, offset, count, checksum });
  }
  for (const name of Object.keys(REQUIRED))
    if (!sections.has(name)) corrupt(`The file is damaged: it has no section ${name}.`);
  return sections;
}

/** Calls `read` with the offset of each row of a section. */
export function readRows<T>(
  view: DataView,
  { offset, stride, count }: Section,
  read: (at: number) => T,
): T[] {
  if (offset + stride * count > view.byteLength) corrupt("The file is damaged.");
  return Array.from({ length: count }, (_, i) => read(offset + i * stride));
}

/** The JSON object in a section; an empty one where it cannot be read. */
export function readJson(bytes: Uint8Array, section: Section | undefined): Json {
  if (!section) return {};
  const { offset, count } = section;
  try {
    const text = new TextDecoder("utf-8", { fatal: true }).decode(
      bytes.subarray(offset, offset + count),
    );
    return jsonOf(JSON.parse(text || "{}"));
  } catch {
    return {}; // the geometry can be shown without it
  }
}
