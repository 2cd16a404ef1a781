// A group in the form that the GPU takes, with the properties of its clusters.

import type { GroupGeometry, GroupInfo } from "../decode/group.js";
import { type Attribute, UV_SETS } from "../format/attributes.js";
import { NONE } from "../format/file_header.js";
import type { GroupDag } from "../select/group_dag.js";
import { type MaterialRanges, materialRangesOf } from "./material_ranges.js";
import { type TextureSizes, textureSizesOf } from "./texture_sizes.js";

export interface RenderGroup extends MaterialRanges, TextureSizes {
  /** Groups and clusters of all meshes are numbered through. */
  group: number;
  mesh: number;
  level: number;
  /** Error of the simplified group; infinite for a root. */
  error: number;
  /** Centre and radius. */
  sphere: Float32Array;
  firstCluster: number;
  clusterCount: number;
  /** First vertex and triangle of each cluster, and the end of the last. */
  vertexOffsets: Uint32Array;
  triangleOffsets: Uint32Array;
  /** Counted from the group's first vertex. */
  indices: Uint32Array;
  positions: Float32Array;
  /** Four a vertex, normalised; the fourth is 0. */
  normals?: Int16Array;
  /** Four a vertex, normalised; the fourth is the sign of the bitangent. */
  tangents?: Int16Array;
  uvs?: Float32Array;
  /** Further sets of texture coordinates, where materials use them. */
  uvs1?: Float32Array;
  uvs2?: Float32Array;
  uvs3?: Float32Array;
  /** Four a vertex, normalised, linear. */
  colors?: Uint16Array;
  /** For each cluster: the group that it was made from, that group's error (0 if none), material, box. */
  generating: Uint32Array;
  generatingError: Float32Array;
  material: Uint32Array;
  boxes: Float32Array;
}

const BYTES: Record<string, number> = {
  positions: 12,
  normals: 8,
  tangents: 8,
  uvs: 8,
  uvs1: 8,
  uvs2: 8,
  uvs3: 8,
  colors: 8,
};

/** Includes the four bytes of the cluster's slot, which every vertex has. */
export function bytesPerVertex(attributes: readonly Attribute[]): number {
  return attributes.reduce((sum, { name }) => sum + (BYTES[name ?? ""] ?? 0), 4);
}

export const BYTES_PER_TRIANGLE = 12;

/** Bytes that a group takes on the GPU. */
export function memoryOf(info: GroupInfo, attributes: readonly Attribute[]): number {
  const { clusterCount, vertexOffsets, triangleOffsets } = info;
  return (
    vertexOffsets[clusterCount] * bytesPerVertex(attributes) +
    triangleOffsets[clusterCount] * BYTES_PER_TRIANGLE
  );
}

export function packGroup(geometry: GroupGeometry, dag: GroupDag): RenderGroup {
  const { info, indices, values } = geometry;
  const ranges = materialRangesOf(geometry);
  const packed: RenderGroup = {
    group: info.group,
    mesh: info.mesh,
    level: info.level,
    error: info.error,
    sphere: Float32Array.from(info.sphere),
    firstCluster: info.firstCluster,
    clusterCount: info.clusterCount,
    vertexOffsets: info.vertexOffsets.slice(),
    triangleOffsets: info.triangleOffsets.slice(),
    ...ranges,
    ...textureSizesOf(geometry, ranges),
    indices,
    positions: values.positions ?? new Float32Array(0),
    generating: info.generating.slice(),
    generatingError: Float32Array.from(info.generating, (g) => (g === NONE ? 0 : dag.errorOf(g))),
    material: info.material.slice(),
    boxes: info.boxes.slice(),
  };
  if (values.normals) packed.normals = packDirections(values.normals, 3);
  if (values.tangents) packed.tangents = packDirections(values.tangents, 4);
  for (const set of UV_SETS) {
    const uvs = values[set];
    if (uvs) packed[set] = uvs;
  }
  if (values.colors)
    packed.colors = Uint16Array.from(values.colors, (c) => toUnit(c) * 65535 + 0.5);
  return packed;
}

function toUnit(value: number): number {
  return Math.min(Math.max(value, 0), 1);
}

/** Packs `width` numbers a vertex as four. */
function packDirections(values: Float32Array, width: number): Int16Array {
  const packed = new Int16Array((values.length / width) * 4);
  for (let v = 0; width * v < values.length; ++v)
    for (let i = 0; i < width; ++i) packed[4 * v + i] = Math.round(values[width * v + i] * 32767);
  return packed;
}

export function buffersOf(group: RenderGroup): ArrayBuffer[] {
  return Object.values(group)
    .filter((value) => ArrayBuffer.isView(value))
    .map((view) => (view as Uint8Array).buffer as ArrayBuffer);
}
