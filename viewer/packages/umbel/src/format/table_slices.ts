// Checksums of slices of long tables. The viewer reads the table of pages as a whole and checks each
// slice, so that a file is refused here where a reader of slices would refuse it.

import { corrupt } from "../errors.js";
import type { Section } from "./sections.js";
import { hasChecksum } from "./xxh64.js";

/** Elements of a slice. */
const SLICE = 4096;

/** Checks the slices of a table, if there are checksums of them. */
export function checkSlices(view: DataView, table: Section, sums: Section | undefined): void {
  if (!sums || sums.count === 0) return;
  if (sums.count !== Math.ceil(table.count / SLICE))
    corrupt("The file is damaged: a table has another number of slices than checksums.");
  const end = table.offset + table.stride * table.count;
  if (end > view.byteLength || sums.offset + sums.stride * sums.count > view.byteLength)
    corrupt("The file is damaged.");
  for (let i = 0; i < sums.count; ++i) {
    const begin = table.offset + i * SLICE * table.stride;
    const size = Math.min(SLICE * table.stride, end - begin);
    const slice = new Uint8Array(view.buffer, view.byteOffset + begin, size);
    if (!hasChecksum(slice, view, sums.offset + i * sums.stride))
      corrupt("The file is damaged: the checksum of a slice of a table does not match.");
  }
}
