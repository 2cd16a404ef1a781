// Reads the tables at the start of a group's chunk, behind its references: the ranges of its
// components and its clusters' records, as docs/format.md specifies under "A group's chunk".

import { corrupt } from "../errors.js";
import { BIT_PADDING, BitReader } from "./bit_reader.js";

/** For each component its least value, and the bits of the first vertex's offset from that. */
export interface ComponentRanges {
  lowest: Int32Array;
  bits: Uint8Array;
}

/** What the tables say of the group's clusters, in arrays. */
export interface ChunkTables {
  ranges: ComponentRanges;
  /** Offset of the first cluster's data in the chunk, and the end of each one's. */
  dataAt: number;
  ends: Float64Array;
  vertices: Uint16Array;
  triangles: Uint16Array;
  /** Index among the references, or -1. */
  references: Int32Array;
  materials: Uint32Array;
  /** Lowest and highest corner in steps of the mesh's box, six a cluster. */
  boxes: Uint16Array;
}

export interface TableCounts {
  components: number;
  clusters: number;
  references: number;
}

/** Bytes of a cluster in version 3; bits of one in version 4 at least: two counts. */
const ROW_3 = 24;
const MIN_ROW_BITS = 16;

/** The least bytes that a cluster takes in a page. */
export function leastClusterBytes(version: number): number {
  return version === 3 ? ROW_3 : MIN_ROW_BITS / 8;
}

/** The bits of a number below `count`. */
function bitsBelow(count: number): number {
  return count < 2 ? 0 : 32 - Math.clz32(count - 1);
}

function emptyTables({ components, clusters }: TableCounts, dataAt: number): ChunkTables {
  return {
    ranges: { lowest: new Int32Array(components), bits: new Uint8Array(components) },
    dataAt,
    ends: new Float64Array(clusters),
    vertices: new Uint16Array(clusters),
    triangles: new Uint16Array(clusters),
    references: new Int32Array(clusters),
    materials: new Uint32Array(clusters),
    boxes: new Uint16Array(6 * clusters),
  };
}

function checkTables(tables: ChunkTables, references: number, size: number): void {
  if (tables.ranges.bits.some((width) => width > 32))
    corrupt("A group has a component of more than 32 bits.");
  if (tables.references.some((index) => index >= references))
    corrupt("A cluster was made from no group of the page.");
  if (tables.ends.some((end, i) => end > size || end < (i > 0 ? tables.ends[i - 1] : 0)))
    corrupt("A cluster's data lie outside its group's chunk.");
}

/**
 * Reads the tables at `at` of a chunk.
 * @param chunk the group's chunk, with BIT_PADDING bytes behind it
 */
export function readChunkTables(
  chunk: DataView,
  at: number,
  counts: TableCounts,
  version: number,
): ChunkTables {
  const size = chunk.byteLength - BIT_PADDING;
  const tables = version === 3 ? readBytes(chunk, at, counts) : readBits(chunk, at, counts);
  checkTables(tables, counts.references, size);
  return tables;
}

function readBytes(chunk: DataView, at: number, counts: TableCounts): ChunkTables {
  const first = at + 8 * counts.components;
  const dataAt = first + ROW_3 * counts.clusters;
  if (dataAt > chunk.byteLength - BIT_PADDING) corrupt("A group is larger than its chunk.");
  const tables = emptyTables(counts, dataAt);
  for (let i = 0; i < counts.components; ++i) {
    tables.ranges.lowest[i] = chunk.getInt32(at + 8 * i, true);
    tables.ranges.bits[i] = Math.min(chunk.getUint32(at + 8 * i + 4, true), 255);
  }
  for (let i = 0; i < counts.clusters; ++i) {
    const row = first + ROW_3 * i;
    tables.ends[i] = chunk.getUint32(row, true);
    tables.vertices[i] = chunk.getUint8(row + 4) + 1;
    tables.triangles[i] = chunk.getUint8(row + 5) + 1;
    const from = chunk.getUint16(row + 6, true);
    tables.references[i] = from === 0xffff ? -1 : from;
    tables.materials[i] = chunk.getUint32(row + 8, true);
    for (let j = 0; j < 6; ++j) tables.boxes[6 * i + j] = chunk.getUint16(row + 12 + 2 * j, true);
  }
  return tables;
}

/** How wide the fields of version 4's records are. */
function readWidths(bits: BitReader, references: number) {
  const size = bits.take(6);
  const lowestMaterial = bits.take(32);
  const material = bits.take(6);
  const axes = [0, 1, 2].map(() => ({
    lowest: bits.take(16),
    corner: bits.take(5),
    extent: bits.take(5),
  }));
  if (size > 32 || material > 32 || axes.some((a) => a.corner > 16 || a.extent > 16))
    corrupt("A group's tables have fields of impossible widths.");
  const reference = bitsBelow(references + 1);
  const boxes = axes.reduce((sum, a) => sum + a.corner + a.extent, 0);
  const row = size + MIN_ROW_BITS + reference + material + boxes;
  return { size, lowestMaterial, material, axes, reference, row };
}

function readBits(chunk: DataView, at: number, counts: TableCounts): ChunkTables {
  const bits = new BitReader(chunk);
  bits.at = 8 * at;
  const lowest: number[] = [];
  const widths: number[] = [];
  for (let i = 0; i < counts.components; ++i) {
    lowest.push(bits.take(32) | 0);
    widths.push(bits.take(6));
  }
  const fields = readWidths(bits, counts.references);
  const dataAt = Math.ceil((bits.at + fields.row * counts.clusters) / 8);
  // Allocates only now that the bytes of the file back the counts.
  if (dataAt > chunk.byteLength - BIT_PADDING) corrupt("A group is larger than its chunk.");
  const tables = emptyTables(counts, dataAt);
  tables.ranges.lowest.set(lowest);
  tables.ranges.bits.set(widths);
  let end = dataAt;
  for (let i = 0; i < counts.clusters; ++i) {
    end += bits.take(fields.size);
    tables.ends[i] = end;
    tables.vertices[i] = bits.take(8) + 1;
    tables.triangles[i] = bits.take(8) + 1;
    tables.references[i] = bits.take(fields.reference) - 1;
    tables.materials[i] = fields.lowestMaterial + bits.take(fields.material);
    for (const [axis, { lowest: low, corner, extent }] of fields.axes.entries()) {
      const from = low + bits.take(corner);
      tables.boxes[6 * i + axis] = from;
      tables.boxes[6 * i + axis + 3] = from + bits.take(extent);
    }
  }
  return tables;
}
