// A group as the GPU takes it, and what a program may ask of its clusters.

import type { Attribute } from "./attributes.js";
import type { GroupGeometry } from "./page.js";
import { NONE, type Tables } from "./tables.js";

export interface RenderGroup {
  group: number;
  level: number;
  /** Error once simplified; infinite for a root. */
  error: number;
  /** Centre and radius. */
  sphere: Float32Array;
  firstCluster: number;
  clusterCount: number;
  /** Where each cluster's vertices and triangles begin, and behind the last. */
  vertexOffsets: Uint32Array;
  triangleOffsets: Uint32Array;
  /** Counted from the group's first vertex. */
  indices: Uint32Array;
  positions: Float32Array;
  /** Four a vertex, normalised; the fourth is 0. */
  normals?: Int16Array;
  uvs?: Float32Array;
  /** Four a vertex, normalised, linear. */
  colors?: Uint16Array;
  /** For each cluster: its generating group, that one's error (0 if none), its material, its box. */
  generating: Uint32Array;
  generatingError: Float32Array;
  material: Uint32Array;
  boxes: Float32Array;
}

/** With the number of the cluster's place on the GPU, which every vertex carries. */
export function bytesPerVertex(attributes: readonly Attribute[]): number {
  const bytes = { positions: 12, normals: 8, tangents: 0, uvs: 8, colors: 8 };
  return attributes.reduce((sum, { name }) => sum + bytes[name], 4);
}

export const BYTES_PER_TRIANGLE = 12;

export function packGroup(tables: Tables, geometry: GroupGeometry): RenderGroup {
  const { groups, clusters } = tables;
  const { group, firstCluster, clusterCount, values } = geometry;
  const end = firstCluster + clusterCount;
  const generating = clusters.generating.slice(firstCluster, end);
  const packed: RenderGroup = {
    group,
    level: groups.level[group],
    error: groups.error[group],
    sphere: groups.sphere.slice(4 * group, 4 * group + 4),
    firstCluster,
    clusterCount,
    vertexOffsets: geometry.vertexOffsets,
    triangleOffsets: geometry.triangleOffsets,
    indices: geometry.indices,
    positions: values.positions ?? new Float32Array(0),
    generating,
    generatingError: Float32Array.from(generating, (g) => (g === NONE ? 0 : groups.error[g])),
    material: clusters.material.slice(firstCluster, end),
    boxes: clusters.box.slice(6 * firstCluster, 6 * end),
  };
  if (values.normals) packed.normals = packNormals(values.normals);
  if (values.uvs) packed.uvs = values.uvs;
  if (values.colors)
    packed.colors = Uint16Array.from(values.colors, (c) => toUnit(c) * 65535 + 0.5);
  return packed;
}

function toUnit(value: number): number {
  return Math.min(Math.max(value, 0), 1);
}

function packNormals(normals: Float32Array): Int16Array {
  const packed = new Int16Array((normals.length / 3) * 4);
  for (let v = 0; 3 * v < normals.length; ++v)
    for (let i = 0; i < 3; ++i) packed[4 * v + i] = Math.round(normals[3 * v + i] * 32767);
  return packed;
}

export function buffersOf(group: RenderGroup): ArrayBuffer[] {
  return Object.values(group)
    .filter((value) => ArrayBuffer.isView(value))
    .map((view) => (view as Uint8Array).buffer as ArrayBuffer);
}
