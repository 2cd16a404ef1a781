// Intersects rays with the drawn clusters.

import { type Intersection, type Object3D, type Ray, type Raycaster, Vector3 } from "three";
import type { ClusterInfo, UmbelIntersection } from "./cluster_info.js";
import type { ResidentGroup, ResidentGroups } from "./geometry/resident_groups.js";
import type { MeshInstance } from "./mesh_instance.js";

export function castRay(
  object: Object3D,
  instances: readonly MeshInstance[],
  residents: ResidentGroups,
  raycaster: Raycaster,
  intersections: Intersection[],
): void {
  for (const instance of instances) {
    const world = instance.worldMatrix();
    const ray = raycaster.ray.clone().applyMatrix4(world.clone().invert());
    for (const cluster of instance.clusters()) {
      const resident = residents.get(cluster.group);
      if (!resident || !ray.intersectsBox(cluster.box)) continue;
      const hit = intersectCluster(ray, cluster, resident, (local) => {
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
  { group, allocation }: ResidentGroup,
  hitAt: (point: Vector3) => Hit | undefined,
): Hit | undefined {
  const { triangleOffsets, firstCluster } = group;
  const { indices, positions } = allocation;
  const i = cluster - firstCluster;
  const corners = [new Vector3(), new Vector3(), new Vector3()] as const;
  const point = new Vector3();
  let nearest: Hit | undefined;
  for (let t = triangleOffsets[i]; t < triangleOffsets[i + 1]; ++t) {
    corners.forEach((corner, j) => {
      corner.fromArray(positions, 3 * indices[3 * t + j]);
    });
    if (!ray.intersectTriangle(...corners, false, point)) continue;
    const hit = hitAt(point);
    if (hit && hit.distance < (nearest?.distance ?? Infinity)) nearest = hit;
  }
  return nearest;
}
