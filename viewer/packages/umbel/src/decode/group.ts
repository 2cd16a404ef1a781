// Decodes a group of a page: its record, its references to other groups, and its clusters.

import { corrupt } from "../errors.js";
import { type FileHeader, NONE } from "../format/file_header.js";
import {
  type GroupReference,
  type MeshEntry,
  REFERENCE_ROW,
  readReference,
} from "../format/tables.js";
import { decodeValues, type Values } from "./attribute_values.js";
import { BIT_PADDING, BitReader } from "./bit_reader.js";
import { type ChunkTables, readChunkTables } from "./chunk_tables.js";
import { closes, predictors, TriangleDecoder } from "./connectivity.js";
import { SharedVertices } from "./shared_vertices.js";
import { Twins } from "./twins.js";
import { decodeVertices } from "./vertices.js";
import { decodeVertices3 } from "./vertices_3.js";
import { type DecodedClusters, decodeClusters } from "./wasm_decoder.js";

/** A group without its geometry. Groups and clusters of all meshes are numbered through. */
export interface GroupInfo {
  group: number;
  mesh: number;
  page: number;
  level: number;
  /** Number of the simplification method that made its coarser form. */
  method: number;
  /** Number of parents in the DAG. */
  parents: number;
  /** Error of the simplified group; infinite for a root. */
  error: number;
  /** Centre and radius. */
  sphere: readonly [number, number, number, number];
  /** Its children in the DAG: the groups that its clusters were made from. */
  references: GroupReference[];
  firstCluster: number;
  clusterCount: number;
  /** First vertex and triangle of each cluster, and the end of the last. */
  vertexOffsets: Uint32Array;
  triangleOffsets: Uint32Array;
  /** For each cluster the group that it was made from; NONE for the source's clusters. */
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

const triangleDecoder = new TriangleDecoder();

/** Reads one group of a page; its data are a chunk of the page. */
export class GroupReader {
  private readonly chunk: DataView;
  private readonly info: GroupInfo;
  private readonly tables: ChunkTables;
  /** Components that clusters store. */
  private readonly stored: number;

  constructor(
    private readonly header: FileHeader,
    page: number,
    view: DataView,
    row: number,
  ) {
    const word = (i: number) => view.getUint32(row + 4 * i, true);
    const float = (i: number) => view.getFloat32(row + 4 * i, true);
    const mesh = header.meshes[word(0)];
    const clusterCount = word(3);
    if (!mesh || word(1) >= mesh.groups || word(2) + clusterCount > mesh.clusters)
      corrupt(`A group of page ${page} is not in the file's tables.`);
    if (word(13) + word(14) > view.byteLength - BIT_PADDING)
      corrupt(`A group of page ${page} does not lie in it.`);
    this.chunk = new DataView(view.buffer, word(13), word(14) + BIT_PADDING);
    if (REFERENCE_ROW * word(7) > word(14))
      corrupt(`A group of page ${page} is larger than its chunk.`);
    const counts = {
      components: mesh.smooth.length,
      clusters: clusterCount,
      references: word(7),
    };
    const tablesAt = REFERENCE_ROW * word(7);
    const { major } = header.fixed;
    this.tables = readChunkTables(this.chunk, tablesAt, counts, major);
    this.stored = this.tables.ranges.bits.reduce((n, b) => n + (b > 0 || major === 3 ? 1 : 0), 0);
    this.info = {
      group: mesh.firstGroup + word(1),
      mesh: word(0),
      page,
      firstCluster: mesh.firstCluster + word(2),
      clusterCount,
      level: word(4),
      method: word(5),
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

  /** @param byWasm whether WebAssembly may decode the clusters */
  read(byWasm: boolean): GroupGeometry {
    const { info, chunk, tables } = this;
    const { attributes } = this.mesh;
    for (let i = 0; i < info.clusterCount; ++i) this.readCluster(i);
    // Allocates only now: readCluster has checked the counts against the bytes of the file.
    const vertexCount = info.vertexOffsets[info.clusterCount];
    const triangleCount = info.triangleOffsets[info.clusterCount];
    const { major } = this.header.fixed;
    const clusters =
      (byWasm
        ? decodeClusters(major, attributes, tables, chunk, vertexCount, triangleCount)
        : undefined) ?? this.readClusters(vertexCount, triangleCount);
    const { indices, rows, stride } = clusters;
    return { info, indices, values: decodeValues(attributes, rows, stride, vertexCount) };
  }

  /** What `decodeClusters` does, in TypeScript. */
  private readClusters(vertexCount: number, triangleCount: number): DecodedClusters {
    const { info, chunk, tables } = this;
    const stride = this.mesh.smooth.length;
    const indices = new Uint32Array(3 * triangleCount);
    const rows = new Int32Array(stride * vertexCount);
    const shared = new SharedVertices(vertexCount);
    const twins = this.header.fixed.major === 3 ? undefined : new Twins(vertexCount, shared);
    const bits = new BitReader(chunk);
    let begin = tables.dataAt;
    for (let i = 0; i < info.clusterCount; ++i) {
      const first = info.vertexOffsets[i];
      const count = info.vertexOffsets[i + 1] - first;
      const firstTriangle = info.triangleOffsets[i];
      const triangles = info.triangleOffsets[i + 1] - firstTriangle;
      bits.at = 8 * begin;
      triangleDecoder.decode(
        this.header.fixed.major,
        bits,
        count,
        triangles,
        indices,
        3 * firstTriangle,
        first,
      );
      shared.read(bits, triangleDecoder.borderEdges, first, count);
      twins?.read(bits);
      this.readVertices(bits, shared, twins, rows, indices, i);
      begin = tables.ends[i];
      if (Math.ceil(bits.at / 8) !== begin) corrupt(`Cluster ${info.firstCluster + i} is damaged.`);
    }
    return { indices, rows, stride };
  }

  private readVertices(
    bits: BitReader,
    { equal }: SharedVertices,
    twins: Twins | undefined,
    rows: Int32Array,
    indices: Uint32Array,
    i: number,
  ): void {
    const { smooth, attributes } = this.mesh;
    const { vertexOffsets, triangleOffsets } = this.info;
    const { ranges } = this.tables;
    const first = vertexOffsets[i];
    const count = vertexOffsets[i + 1] - first;
    if (twins === undefined)
      decodeVertices3(bits, smooth, ranges, predictors, equal, rows, first, count);
    else
      decodeVertices(bits, attributes, ranges, {
        rows,
        stride: smooth.length,
        first,
        count,
        indices,
        at: 3 * triangleOffsets[i],
        end: 3 * triangleOffsets[i + 1],
        predictors,
        closes,
        equal,
        twin: twins.twin,
        anyTwin: twins.any,
        version: this.header.fixed.major,
      });
  }

  private get mesh(): MeshEntry {
    return this.header.meshes[this.info.mesh] as MeshEntry;
  }

  private references(firstGroup: number, groups: number, count: number): GroupReference[] {
    if (REFERENCE_ROW * count > this.chunk.byteLength)
      corrupt("A group's references do not lie in its chunk.");
    return Array.from({ length: count }, (_, i) => {
      const reference = readReference(this.chunk, REFERENCE_ROW * i, firstGroup);
      if (reference.group - firstGroup >= groups || reference.page >= this.header.pages.count)
        corrupt("A group was made from one that is not there.");
      return reference;
    });
  }

  private readCluster(i: number): void {
    const { info, tables } = this;
    const { low, high } = this.mesh;
    const vertices = tables.vertices[i];
    const triangles = tables.triangles[i];
    const begin = i > 0 ? tables.ends[i - 1] : tables.dataAt;
    const bits = 8 * (tables.ends[i] - begin);
    const { maxVertices, maxTriangles } = this.header.fixed;
    // A bit for each triangle, and the parameters that precede the vertices.
    const minBits = triangles + 5 * this.stored + 2;
    const isTooLarge = vertices > Math.min(maxVertices, 3 * triangles) || triangles > maxTriangles;
    if (isTooLarge || bits < minBits)
      corrupt(`Cluster ${info.firstCluster + i} is larger than the file says.`);
    info.vertexOffsets[i + 1] = info.vertexOffsets[i] + vertices;
    info.triangleOffsets[i + 1] = info.triangleOffsets[i] + triangles;
    const from = tables.references[i];
    info.generating[i] = from < 0 ? NONE : (info.references[from] as GroupReference).group;
    info.material[i] = tables.materials[i];
    for (let j = 0; j < 6; ++j) {
      const axis = j % 3;
      const q = tables.boxes[6 * i + j];
      info.boxes[6 * i + j] = low[axis] + (high[axis] - low[axis]) * (q / 65535);
    }
  }
}
