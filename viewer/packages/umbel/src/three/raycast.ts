// Intersects rays with the drawn clusters: with the sides of triangles that their materials show.

import {
  BackSide,
  FrontSide,
  type Intersection,
  type Object3D,
  type Ray,
  type Raycaster,
  type Side,
  Vector3,
} from "three";
import type { ClusterInfo, UmbelIntersection } from "./cluster_info.js";
import type { VertexLayout } from "./geometry/arena.js";
import type { ResidentGroup, ResidentGroups } from "./geometry/resident_groups.js";
import type { MeshInstance } from "./mesh_instance.js";

/** Which sides of triangles the material of an index shows, for vertices of a layout. */
export type SideOf = (material: number, layout: VertexLayout) => Side;

export function castRay(
  object: Object3D,
  instances: readonly MeshInstance[],
  residents: ResidentGroups,
  sideOf: SideOf,
  raycaster: Raycaster,
  intersections: Intersection[],
): void {
  for (const instance of instances) {
    const world = instance.worldMatrix();
    const ray = raycaster.ray.clone().applyMatrix4(world.clone().invert());
    for (const cluster of instance.clusters()) {
      const resident = residents.get(cluster.group);
      if (!resident || !ray.intersectsBox(cluster.box)) continue;
      const hit = intersectCluster(ray, cluster, resident, sideOf, (local) => {
        const point = local.clone().applyMatrix4(world);
        const distance = raycaster.ray.origin.distanceTo(point);
        const isInRange = distance >= raycaster.near && distance <= raycaster.far;
        return isInRange ? { point, distance } : undefined;
      });
      if (!hit) continue;
      const found: UmbelIntersection = { ...hit, object, cluster };
      intersections.push(found);
    }
  }
}

interface Hit {
  point: Vector3;
  distance: number;
}

/** The nearest intersection for which `hitAt` returns a hit. */
function intersectCluster(
  ray: Ray,
  { cluster }: ClusterInfo,
  { group, allocation, arena }: ResidentGroup,
  sideOf: SideOf,
  hitAt: (point: Vector3) => Hit | undefined,
): Hit | undefined {
  const { rangeOffsets, rangeMaterials, rangeTriangles, firstCluster } = group;
  const { indices, positions } = allocation;
  const i = cluster - firstCluster;
  const [a, b, c] = [new Vector3(), new Vector3(), new Vector3()];
  const point = new Vector3();
  let nearest: Hit | undefined;
  for (let range = rangeOffsets[i]; range < rangeOffsets[i + 1]; ++range) {
    const side = sideOf(rangeMaterials[range], arena.layout);
    const [first, last] = side === BackSide ? [c, a] : [a, c];
    const isSingle = side === BackSide || side === FrontSide;
    for (let t = rangeTriangles[range]; t < rangeTriangles[range + 1]; ++t) {
      a.fromArray(positions, 3 * indices[3 * t]);
      b.fromArray(positions, 3 * indices[3 * t + 1]);
      c.fromArray(positions, 3 * indices[3 * t + 2]);
      if (!ray.intersectTriangle(first, b, last, isSingle, point)) continue;
      const hit = hitAt(point);
      if (hit && hit.distance < (nearest?.distance ?? Infinity)) nearest = hit;
    }
  }
  return nearest;
}
