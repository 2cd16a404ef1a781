// What the page learns of an asset when it is opened.

import type { FileHeader } from "../format/file_header.js";
import type { Json } from "../format/gltf.js";
import type { Instance, MeshEntry } from "../format/tables.js";

/** What an asset has, for the page. */
export interface AssetInfo {
  fileBytes: number;
  headerBytes: number;
  /** Of the full meshes, each counted once. */
  sourceTriangles: number;
  sourceVertices: number;
  /** Of the full meshes, each counted once an instance; with a tree of instances undefined. */
  instancedTriangles: number | undefined;
  levels: number;
  groups: number;
  clusters: number;
  pages: number;
  meshes: MeshInfo[];
  /** Those that the header lists: with a tree of instances, the stand-ins of its root. */
  instances: Instance[];
  hasInstanceTree: boolean;
  /** Position of the asset's zero in its world, in binary64. */
  origin: [number, number, number];
  metadata: Json;
  /** glTF's materials, textures, samplers and images. */
  materials: Json;
  /** glTF's nodes, cameras, skins and extensions of the scene. */
  scene: Json;
}

export interface MeshInfo {
  low: [number, number, number];
  high: [number, number, number];
  levels: number;
  attributes: string[];
  /** Attributes that are not shown: "joints", "texture coordinates", "unknown". */
  skipped: string[];
}

/** Attributes that are not shown, by their kind. */
const SKIPPED = new Map([
  [4, "texture coordinates"],
  [16, "joints"],
  [32, "joints"],
]);

export function assetInfoOf(header: FileHeader): AssetInfo {
  const { fixed, meshes, instances, pages } = header;
  const sum = (of: (mesh: MeshEntry) => number) =>
    meshes.reduce((total, mesh) => total + of(mesh), 0);
  return {
    fileBytes: fixed.fileBytes,
    headerBytes: fixed.headerBytes,
    sourceTriangles: sum((mesh) => mesh.sourceTriangles),
    sourceVertices: sum((mesh) => mesh.sourceVertices),
    instancedTriangles: header.tree
      ? undefined
      : instances.reduce((total, { mesh }) => total + (meshes[mesh]?.sourceTriangles ?? 0), 0),
    levels: meshes.reduce((max, mesh) => Math.max(max, mesh.levels), 0),
    groups: header.groups,
    clusters: header.clusters,
    pages: pages.count,
    meshes: meshes.map(({ low, high, levels, attributes }) => ({
      low: [low[0], low[1], low[2]],
      high: [high[0], high[1], high[2]],
      levels,
      attributes: attributes.flatMap(({ name }) => name ?? []),
      skipped: attributes.flatMap(({ name, kind }) =>
        name ? [] : (SKIPPED.get(kind) ?? "unknown"),
      ),
    })),
    instances,
    hasInstanceTree: header.tree !== undefined,
    origin: header.origin,
    metadata: header.metadata,
    materials: header.materials,
    scene: header.scene,
  };
}
