// A page of an .umbel file: what some groups say of themselves and of those they were made from, and
// their geometry, as docs/format.md describes it under "Page".

import { corrupt, UmbelError } from "../errors.js";
import { decodeValues, type Values } from "../format/attributes.js";
import { type Head, NONE, type Reference, readReference } from "../format/file_header.js";
import { hasChecksum } from "../format/xxh64.js";
import { BIT_PADDING, BitReader } from "./bit_reader.js";
import { TriangleDecoder } from "./connectivity.js";
import { SharedVertices } from "./shared_vertices.js";
import { decodeVertices } from "./vertices.js";

/** What is known of a group once its page was read. Groups and clusters are numbered through. */
export interface GroupInfo {
  group: number;
  mesh: number;
  page: number;
  level: number;
  rung: number;
  parents: number;
  /** Once simplified; infinite for a root. */
  error: number;
  /** Centre and radius. */
  sphere: readonly [number, number, number, number];
  /** The groups that its clusters were made from. */
  references: Reference[];
  firstCluster: number;
  clusterCount: number;
  /** Where each cluster's vertices and triangles begin, and behind the last. */
  vertexOffsets: Uint32Array;
  triangleOffsets: Uint32Array;
  /** For each cluster the group that it was made from, or NONE. */
  generating: Uint32Array;
  material: Uint32Array;
  /** Lowest and highest corner, six a cluster. */
  boxes: Float32Array;
}

export interface GroupGeometry {
  info: GroupInfo;
  /** Three vertices a triangle, counted from the group's first. */
  indices: Uint32Array;
  values: Values;
}

const PAGE_HEADER = 16;
const GROUP_ROW = 64;
const CLUSTER_ROW = 24;

/** Decodes the bytes of page `page`; throws an UmbelError of kind "corrupt" if they are damaged. */
export function readPage(head: Head, page: number, bytes: Uint8Array): GroupGeometry[] {
  const { pages } = head;
  const stored = new DataView(pages.checksum.buffer, 8 * page, 8);
  if (bytes.length !== pages.size[page] || !hasChecksum(bytes, stored, 0))
    corrupt(`Page ${page} of the file is damaged.`);
  const padded = new Uint8Array(bytes.length + BIT_PADDING);
  padded.set(bytes);
  const view = new DataView(padded.buffer);
  try {
    if (view.getUint32(0, true) !== page || view.getUint32(4, true) !== pages.groups[page])
      corrupt(`Page ${page} of the file is another.`);
    let end = PAGE_HEADER + GROUP_ROW * pages.groups[page];
    return Array.from({ length: pages.groups[page] }, (_, i) => {
      const row = PAGE_HEADER + GROUP_ROW * i;
      const begin = view.getUint32(row + 52, true);
      // Parts that overlap could make much of few bytes.
      if (begin < end) corrupt(`Two groups of page ${page} lie in one another.`);
      end = begin + view.getUint32(row + 56, true);
      return new GroupReader(head, page, view, row).read();
    });
  } catch (error) {
    if (error instanceof UmbelError) throw error;
    if (error instanceof RangeError) corrupt(`Page ${page} of the file ends too early.`);
    throw error;
  }
}

const walk = new TriangleDecoder();

class GroupReader {
  private readonly part: DataView;
  private readonly info: GroupInfo;
  private readonly componentsAt: number;
  private readonly clustersAt: number;

  constructor(
    private readonly head: Head,
    page: number,
    view: DataView,
    row: number,
  ) {
    const word = (i: number) => view.getUint32(row + 4 * i, true);
    const float = (i: number) => view.getFloat32(row + 4 * i, true);
    const mesh = head.meshes[word(0)];
    const clusterCount = word(3);
    if (!mesh || word(1) >= mesh.groups || word(2) + clusterCount > mesh.clusters)
      corrupt(`A group of page ${page} is not in the file's tables.`);
    if (word(13) + word(14) > view.byteLength - BIT_PADDING)
      corrupt(`A group of page ${page} does not lie in it.`);
    this.part = new DataView(view.buffer, word(13), word(14) + BIT_PADDING);
    this.componentsAt = 32 * word(7);
    this.clustersAt = this.componentsAt + 8 * mesh.smooth.length;
    if (this.clustersAt + CLUSTER_ROW * clusterCount > word(14))
      corrupt(`A group of page ${page} is larger than its part.`);
    this.info = {
      group: mesh.firstGroup + word(1),
      mesh: word(0),
      page,
      firstCluster: mesh.firstCluster + word(2),
      clusterCount,
      level: word(4),
      rung: word(5),
      parents: word(6),
      sphere: [float(8), float(9), float(10), float(11)],
      error: float(12),
      references: this.references(mesh.firstGroup, mesh.groups, word(7)),
      vertexOffsets: new Uint32Array(clusterCount + 1),
      triangleOffsets: new Uint32Array(clusterCount + 1),
      generating: new Uint32Array(clusterCount),
      material: new Uint32Array(clusterCount),
      boxes: new Float32Array(6 * clusterCount),
    };
  }

  read(): GroupGeometry {
    const { info, part } = this;
    const { attributes } = this.mesh;
    for (let i = 0; i < info.clusterCount; ++i) this.readCluster(i);
    // Only now memory for them: every triangle is a bit of the file or more.
    const vertexCount = info.vertexOffsets[info.clusterCount];
    const indices = new Uint32Array(3 * info.triangleOffsets[info.clusterCount]);
    const rows = new Int32Array(this.mesh.smooth.length * vertexCount);
    const shared = new SharedVertices(vertexCount);
    const ranges = this.ranges();
    const bits = new BitReader(part);
    let begin = this.dataAt;
    for (let i = 0; i < info.clusterCount; ++i) {
      const end = part.getUint32(this.clustersAt + CLUSTER_ROW * i, true);
      const first = info.vertexOffsets[i];
      const count = info.vertexOffsets[i + 1] - first;
      const firstTriangle = info.triangleOffsets[i];
      const triangles = info.triangleOffsets[i + 1] - firstTriangle;
      bits.at = 8 * begin;
      walk.decode(bits, count, triangles, indices, 3 * firstTriangle, first);
      shared.read(bits, walk, first, count);
      decodeVertices(
        bits,
        this.mesh.smooth,
        ranges,
        walk.parents,
        shared.equal,
        rows,
        first,
        count,
      );
      if (Math.ceil(bits.at / 8) !== end) corrupt(`Cluster ${info.firstCluster + i} is damaged.`);
      begin = end;
    }
    return { info, indices, values: decodeValues(attributes, rows, vertexCount) };
  }

  /** Where the data of the first cluster begin. */
  private get dataAt(): number {
    return this.clustersAt + CLUSTER_ROW * this.info.clusterCount;
  }

  private get mesh() {
    return this.head.meshes[this.info.mesh] as Head["meshes"][number];
  }

  private references(firstGroup: number, groups: number, count: number): Reference[] {
    if (32 * count > this.part.byteLength) corrupt("A group's references do not lie in its part.");
    return Array.from({ length: count }, (_, i) => {
      const reference = readReference(this.part, 32 * i, firstGroup);
      if (reference.group - firstGroup >= groups || reference.page >= this.head.pages.count)
        corrupt("A group was made from one that is not there.");
      return reference;
    });
  }

  private ranges(): { lowest: Int32Array; bits: Uint8Array } {
    const count = this.mesh.smooth.length;
    const ranges = { lowest: new Int32Array(count), bits: new Uint8Array(count) };
    for (let i = 0; i < count; ++i) {
      ranges.lowest[i] = this.part.getInt32(this.componentsAt + 8 * i, true);
      const width = this.part.getUint32(this.componentsAt + 8 * i + 4, true);
      if (width > 32) corrupt(`Group ${this.info.group} has a component of ${width} bits.`);
      ranges.bits[i] = width;
    }
    return ranges;
  }

  private readCluster(i: number): void {
    const { info, part } = this;
    const { low, high } = this.mesh;
    const row = this.clustersAt + CLUSTER_ROW * i;
    const vertices = part.getUint8(row + 4) + 1;
    const triangles = part.getUint8(row + 5) + 1;
    const begin = i > 0 ? part.getUint32(row - CLUSTER_ROW, true) : this.dataAt;
    const bits = 8 * (part.getUint32(row, true) - begin);
    const { maxVertices, maxTriangles } = this.head.header;
    // A bit for each triangle, and what the code of the vertices begins with.
    const least = triangles + 5 * this.mesh.smooth.length + 2;
    const isTooLarge = vertices > Math.min(maxVertices, 3 * triangles) || triangles > maxTriangles;
    if (isTooLarge || bits < least)
      corrupt(`Cluster ${info.firstCluster + i} is larger than the file says.`);
    info.vertexOffsets[i + 1] = info.vertexOffsets[i] + vertices;
    info.triangleOffsets[i + 1] = info.triangleOffsets[i] + triangles;
    const from = part.getUint16(row + 6, true);
    if (from !== 0xffff && from >= info.references.length)
      corrupt(`Cluster ${info.firstCluster + i} was made from no group of the page.`);
    info.generating[i] = from === 0xffff ? NONE : (info.references[from] as Reference).group;
    info.material[i] = part.getUint32(row + 8, true);
    for (let j = 0; j < 6; ++j) {
      const axis = j % 3;
      const q = part.getUint16(row + 12 + 2 * j, true);
      info.boxes[6 * i + j] = low[axis] + (high[axis] - low[axis]) * (q / 65535);
    }
  }
}
