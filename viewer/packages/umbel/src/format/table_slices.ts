// Checksums of slices of long tables.

import { corrupt } from "../errors.js";
import type { Section } from "./sections.js";
import { hasChecksum } from "./xxh64.js";

/** Elements of a slice. */
export const SLICE = 4096;

/** The checksums of a table's slices; undefined where there are none. */
export function checksumsOf(
  view: DataView,
  table: Section,
  sums: Section | undefined,
): DataView | undefined {
  if (!sums || sums.count === 0) return undefined;
  if (sums.count !== Math.ceil(table.count / SLICE))
    corrupt("The file is damaged: a table has another number of slices than checksums.");
  if (sums.offset + sums.stride * sums.count > view.byteLength) corrupt("The file is damaged.");
  const copy = new DataView(new ArrayBuffer(8 * sums.count));
  for (let i = 0; i < sums.count; ++i)
    copy.setBigUint64(8 * i, view.getBigUint64(sums.offset + i * sums.stride));
  return copy;
}

/** Checks one slice of a table. */
export function checkSlice(bytes: Uint8Array, sums: DataView, slice: number): void {
  if (!hasChecksum(bytes, sums, 8 * slice))
    corrupt("The file is damaged: the checksum of a slice of a table does not match.");
}

/** Checks all slices of a table, if there are checksums of them. */
export function checkSlices(view: DataView, table: Section, sums: Section | undefined): void {
  const checksums = checksumsOf(view, table, sums);
  if (!checksums) return;
  const end = table.offset + table.stride * table.count;
  if (end > view.byteLength) corrupt("The file is damaged.");
  for (let i = 0; i < checksums.byteLength / 8; ++i) {
    const begin = table.offset + i * SLICE * table.stride;
    const size = Math.min(SLICE * table.stride, end - begin);
    checkSlice(new Uint8Array(view.buffer, view.byteOffset + begin, size), checksums, i);
  }
}
