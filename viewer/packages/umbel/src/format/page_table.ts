// The table of pages. That of a large file is read in slices, each when a page in it is wanted.

import { corrupt } from "../errors.js";
import { readU64 } from "./binary.js";
import type { FixedHeader, Section } from "./sections.js";
import { checkSlice, checkSlices, SLICE } from "./table_slices.js";
import { GROUP_ROW, PAGE_HEADER } from "./tables.js";

/** More pages than the largest file that is read. */
const MAX_PAGES = 2 ** 24;

export interface PageTable {
  count: number;
  /** Zero for pages whose slice is not read, as all that follows. */
  offset: Float64Array;
  size: Uint32Array;
  groups: Uint32Array;
  /** Low and high half, two a page. */
  checksum: Uint32Array;
  /** For each slice of 4096 pages: 1 if it is read. */
  isRead: Uint8Array;
  /** Where the table lies in the file. */
  section: Section;
  /** The checksums of the slices. */
  sums: DataView | undefined;
}

export function emptyPageTable(section: Section, sums: DataView | undefined): PageTable {
  const { count } = section;
  if (count > MAX_PAGES) corrupt("The file is damaged: it names an impossible number of pages.");
  // The system gives memory to those parts only that are written.
  return {
    count,
    offset: new Float64Array(count),
    size: new Uint32Array(count),
    groups: new Uint32Array(count),
    checksum: new Uint32Array(2 * count),
    isRead: new Uint8Array(Math.ceil(count / SLICE)),
    section,
    sums,
  };
}

/** The number of the slice that a page is in. */
export function sliceOf(page: number): number {
  return Math.floor(page / SLICE);
}

/** Where a slice lies in the file. */
export function placeOf({ count, section }: PageTable, slice: number): [number, number] {
  const rows = Math.min(SLICE, count - slice * SLICE);
  return [section.offset + slice * SLICE * section.stride, rows * section.stride];
}

/** Reads the whole table from the file header. */
export function readPages(
  view: DataView,
  section: Section,
  sums: Section | undefined,
  fixed: FixedHeader,
): PageTable {
  const size = section.stride * section.count;
  if (section.offset + size > view.byteLength) corrupt("The file is damaged.");
  checkSlices(view, section, sums);
  const pages = emptyPageTable(section, undefined);
  readRows(pages, 0, new DataView(view.buffer, view.byteOffset + section.offset, size), fixed);
  pages.isRead.fill(1);
  return pages;
}

/** Reads a slice from its bytes, and checks it. */
export function readSlice(
  pages: PageTable,
  slice: number,
  bytes: Uint8Array,
  fixed: FixedHeader,
): void {
  const [, size] = placeOf(pages, slice);
  if (bytes.length !== size) corrupt("The file is cut off in its tables.");
  if (pages.sums) checkSlice(bytes, pages.sums, slice);
  const view = new DataView(bytes.buffer, bytes.byteOffset, size);
  readRows(pages, slice * SLICE, view, fixed);
  pages.isRead[slice] = 1;
}

/** Reads the rows in `view`, of page `first` and on. */
function readRows(pages: PageTable, first: number, view: DataView, fixed: FixedHeader): void {
  const { stride } = pages.section;
  const rows = view.byteLength / stride;
  let end = fixed.headerBytes;
  for (let i = 0; i < rows; ++i) {
    const [p, row] = [first + i, i * stride];
    const offset = readU64(view, row);
    const size = view.getUint32(row + 8, true);
    const groups = view.getUint32(row + 12, true);
    if (offset < end || offset + size > fixed.fileBytes)
      corrupt(`The file is damaged: page ${p} overlaps another.`);
    if (PAGE_HEADER + GROUP_ROW * groups > size)
      corrupt(`The file is damaged: page ${p} cannot hold its groups.`);
    end = offset + size;
    pages.offset[p] = offset;
    pages.size[p] = size;
    pages.groups[p] = groups;
    pages.checksum[2 * p] = view.getUint32(row + 16, true);
    pages.checksum[2 * p + 1] = view.getUint32(row + 20, true);
  }
}
