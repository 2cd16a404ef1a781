// The properties of a resident cluster.

import { Box3, type Intersection, type Matrix4, Vector3 } from "three";
import type { RenderGroup } from "../pack/render_group.js";

/** A resident cluster. */
export interface ClusterInfo {
  cluster: number;
  group: number;
  level: number;
  /** Error of the cluster: its greatest distance from the full mesh. */
  error: number;
  /** Error of its simplified group; infinite for a root. */
  groupError: number;
  /** The group that it was made from; NONE for the source's clusters. */
  generating: number;
  material: number;
  triangles: number;
  vertices: number;
  /** In the mesh's space; `matrix` transforms it to the object's. */
  box: Box3;
  instance: number;
  matrix: Matrix4;
  /** Whether finer clusters are selected here but have not arrived. */
  isPending: boolean;
}

/** The tint of a cluster: red, green, blue (sRGB) and opacity, from 0 to 1. */
export type TintFunction = (cluster: ClusterInfo) => readonly [number, number, number, number];

export interface UmbelIntersection extends Intersection {
  cluster: ClusterInfo;
}

export function boxOf(group: RenderGroup, i: number): Box3 {
  return new Box3(
    new Vector3().fromArray(group.boxes, 6 * i),
    new Vector3().fromArray(group.boxes, 6 * i + 3),
  );
}

export function clusterInfo(
  group: RenderGroup,
  cluster: number,
  isPending: boolean,
): Omit<ClusterInfo, "instance" | "matrix"> {
  const i = cluster - group.firstCluster;
  return {
    cluster,
    group: group.group,
    level: group.level,
    error: group.generatingError[i],
    groupError: group.error,
    generating: group.generating[i],
    material: group.material[i],
    triangles: group.triangleOffsets[i + 1] - group.triangleOffsets[i],
    vertices: group.vertexOffsets[i + 1] - group.vertexOffsets[i],
    box: boxOf(group, i),
    isPending,
  };
}
