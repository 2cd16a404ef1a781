// A page of an .umbel file: the geometry of a group, as docs/format.md describes it under "Page".

import { decodeValues, type Values } from "./attributes.js";
import { BIT_PADDING, BitReader } from "./bits.js";
import { TriangleDecoder } from "./connectivity.js";
import { corrupt, UmbelError } from "./errors.js";
import type { Tables } from "./tables.js";
import { decodeVertices } from "./vertices.js";
import { hasChecksum } from "./xxh64.js";

/** The clusters of one group, their vertices and triangles one after the other. */
export interface GroupGeometry {
  group: number;
  firstCluster: number;
  clusterCount: number;
  /** Where each cluster's vertices begin, and behind the last. */
  vertexOffsets: Uint32Array;
  /** Where each cluster's triangles begin, and behind the last. */
  triangleOffsets: Uint32Array;
  /** Three vertices a triangle, counted from the group's first. */
  indices: Uint32Array;
  values: Values;
}

const triangles = new TriangleDecoder();

/** Decodes the bytes of page `page`; throws an UmbelError of kind "corrupt" if they are damaged. */
export function readPage(tables: Tables, page: number, bytes: Uint8Array): GroupGeometry[] {
  const { pages } = tables;
  const stored = new DataView(pages.checksum.buffer, 8 * page, 8);
  if (bytes.length !== pages.size[page] || !hasChecksum(bytes, stored, 0))
    corrupt(`Page ${page} of the file is damaged.`);
  try {
    return [readGroup(tables, pages.group[page], bytes)];
  } catch (error) {
    if (error instanceof UmbelError) throw error;
    if (error instanceof RangeError) corrupt(`Page ${page} of the file ends too early.`);
    throw error;
  }
}

function readGroup(tables: Tables, group: number, bytes: Uint8Array): GroupGeometry {
  const { groups, clusters, smooth, attributes } = tables;
  const padded = new Uint8Array(bytes.length + BIT_PADDING);
  padded.set(bytes);
  const view = new DataView(padded.buffer);
  const stride = smooth.length;
  const firstCluster = groups.firstCluster[group];
  const clusterCount = groups.clusterCount[group];
  if (
    view.getUint32(0, true) !== group ||
    view.getUint32(4, true) !== firstCluster ||
    view.getUint32(8, true) !== clusterCount ||
    view.getUint32(12, true) !== stride
  )
    corrupt(`The page of group ${group} is another's.`);

  const ranges = { lowest: new Int32Array(stride), bits: new Uint8Array(stride) };
  for (let i = 0; i < stride; ++i) {
    ranges.lowest[i] = view.getInt32(16 + 8 * i, true);
    const width = view.getUint32(20 + 8 * i, true);
    if (width > 32) corrupt(`The page of group ${group} has a component of ${width} bits.`);
    ranges.bits[i] = width;
  }

  const vertexOffsets = new Uint32Array(clusterCount + 1);
  const triangleOffsets = new Uint32Array(clusterCount + 1);
  for (let i = 0; i < clusterCount; ++i) {
    vertexOffsets[i + 1] = vertexOffsets[i] + clusters.vertices[firstCluster + i];
    triangleOffsets[i + 1] = triangleOffsets[i] + clusters.triangles[firstCluster + i];
  }
  const vertexCount = vertexOffsets[clusterCount];
  const indices = new Uint32Array(3 * triangleOffsets[clusterCount]);
  const rows = new Int32Array(stride * vertexCount);

  const entries = 16 + 8 * stride;
  const bits = new BitReader(view);
  let begin = entries + 8 * clusterCount;
  for (let i = 0; i < clusterCount; ++i) {
    const end = view.getUint32(entries + 8 * i, true);
    const v = view.getUint16(entries + 8 * i + 4, true) + 1;
    const t = view.getUint16(entries + 8 * i + 6, true) + 1;
    if (
      v !== vertexOffsets[i + 1] - vertexOffsets[i] ||
      t !== triangleOffsets[i + 1] - triangleOffsets[i] ||
      end < begin ||
      end > bytes.length
    )
      corrupt(`Cluster ${firstCluster + i} is not as large in its page as in the tables.`);
    bits.at = 8 * begin;
    triangles.decode(bits, v, t, indices, 3 * triangleOffsets[i], vertexOffsets[i]);
    decodeVertices(bits, smooth, ranges, triangles.parents, v, rows, stride * vertexOffsets[i]);
    if (Math.ceil(bits.at / 8) !== end) corrupt(`Cluster ${firstCluster + i} is damaged.`);
    begin = end;
  }
  return {
    group,
    firstCluster,
    clusterCount,
    vertexOffsets,
    triangleOffsets,
    indices,
    values: decodeValues(attributes, rows, vertexCount),
  };
}
