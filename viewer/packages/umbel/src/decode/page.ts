// Decodes a page of an .umbel file: the records and the geometry of some groups, as docs/format.md
// specifies under "Page".

import { corrupt, memoryError, UmbelError } from "../errors.js";
import type { FileHeader } from "../format/file_header.js";
import { GROUP_ROW, PAGE_HEADER } from "../format/tables.js";
import { hasChecksum } from "../format/xxh64.js";
import { BIT_PADDING } from "./bit_reader.js";
import { type GroupGeometry, GroupReader } from "./group.js";

/**
 * Decodes the bytes of page `page`; throws an UmbelError of kind "corrupt" if they are damaged.
 * @param byWasm whether WebAssembly may decode the clusters, once it is there; the result is the same
 */
export function readPage(
  header: FileHeader,
  page: number,
  bytes: Uint8Array,
  byWasm = true,
): GroupGeometry[] {
  const { pages } = header;
  const stored = new DataView(pages.checksum.buffer, 8 * page, 8);
  if (bytes.length !== pages.size[page] || !hasChecksum(bytes, stored, 0))
    corrupt(`Page ${page} of the file is damaged.`);
  const padded = new Uint8Array(bytes.length + BIT_PADDING);
  padded.set(bytes);
  const view = new DataView(padded.buffer);
  try {
    if (view.getUint32(0, true) !== page || view.getUint32(4, true) !== pages.groups[page])
      corrupt(`Page ${page} of the file holds another page.`);
    let end = PAGE_HEADER + GROUP_ROW * pages.groups[page];
    return Array.from({ length: pages.groups[page] }, (_, i) => {
      const row = PAGE_HEADER + GROUP_ROW * i;
      const begin = view.getUint32(row + 52, true);
      // If chunks overlapped, few bytes could claim much memory.
      if (begin < end) corrupt(`Two groups of page ${page} overlap.`);
      end = begin + view.getUint32(row + 56, true);
      return new GroupReader(header, page, view, row).read(byWasm);
    });
  } catch (error) {
    if (error instanceof UmbelError) throw error;
    const noMemory = memoryError(error);
    if (noMemory) throw noMemory;
    if (error instanceof RangeError) corrupt(`Page ${page} of the file ends too early.`);
    throw error;
  }
}
