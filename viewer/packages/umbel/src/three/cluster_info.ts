// What may be asked of a cluster that is in memory.

import { Box3, type Intersection, type Matrix4, Vector3 } from "three";
import type { RenderGroup } from "../stream/render_group.js";

/** A cluster that is in memory. */
export interface ClusterInfo {
  cluster: number;
  group: number;
  level: number;
  /** Of the cluster's own form: how far it may be from the full mesh. */
  error: number;
  /** Of the group once simplified; infinite for a root. */
  groupError: number;
  generating: number;
  material: number;
  triangles: number;
  vertices: number;
  /** In the mesh's own space; the instance's matrix brings it into the object's. */
  box: Box3;
  instance: number;
  matrix: Matrix4;
  /** Whether something finer is wanted here but has not arrived. */
  waits: boolean;
}

/** A colour for a cluster: red, green, blue (sRGB) and how much it covers, 0 to 1. */
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
  waits: boolean,
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
    waits,
  };
}
