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
      const point = intersectCluster(ray, cluster, resident);
      if (!point) continue;
      point.applyMatrix4(world);
      const distance = raycaster.ray.origin.distanceTo(point);
      if (distance < raycaster.near || distance > raycaster.far) continue;
      const found: UmbelIntersection = { distance, point, object, cluster };
      intersections.push(found);
    }
  }
}

function intersectCluster(
  ray: Ray,
  { cluster }: ClusterInfo,
  { group, allocation }: ResidentGroup,
): Vector3 | undefined {
  const { triangleOffsets, firstCluster } = group;
  const { indices, positions } = allocation;
  const i = cluster - firstCluster;
  const corners = [new Vector3(), new Vector3(), new Vector3()] as const;
  const point = new Vector3();
  let nearest: Vector3 | undefined;
  for (let t = triangleOffsets[i]; t < triangleOffsets[i + 1]; ++t) {
    corners.forEach((corner, j) => {
      corner.fromArray(positions, 3 * indices[3 * t + j]);
    });
    if (!ray.intersectTriangle(...corners, false, point)) continue;
    if (!nearest || ray.origin.distanceTo(point) < ray.origin.distanceTo(nearest))
      nearest = point.clone();
  }
  return nearest;
}
