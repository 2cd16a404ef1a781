import {
  BackSide,
  Box3,
  DoubleSide,
  FrontSide,
  Matrix4,
  Object3D,
  Raycaster,
  type Side,
  Vector3,
} from "three";
import { expect, test } from "vitest";
import type { RenderGroup } from "../../../packages/umbel/src/pack/render_group.js";
import type { ClusterInfo } from "../../../packages/umbel/src/three/cluster_info.js";
import type { ResidentGroups } from "../../../packages/umbel/src/three/geometry/resident_groups.js";
import type { MeshInstance } from "../../../packages/umbel/src/three/mesh_instance.js";
import { castRay } from "../../../packages/umbel/src/three/raycast.js";

test("rays find the nearest triangle within their range", () => {
  // A cluster of two triangles, which cut the z axis at 1 and 2.
  const positions = Float32Array.from([1, 2].flatMap((z) => [-1, -1, z, 1, -1, z, 0, 1, z]));
  const group = {
    firstCluster: 0,
    rangeOffsets: Uint32Array.of(0, 1),
    rangeMaterials: Uint32Array.of(7),
    rangeTriangles: Uint32Array.of(0, 2),
  } as unknown as RenderGroup;
  const allocation = { positions, indices: Uint32Array.of(0, 1, 2, 3, 4, 5) };
  const cluster = { cluster: 0, group: 0, box: new Box3().setFromArray(positions) };
  const instance = {
    worldMatrix: () => new Matrix4().makeScale(1, 1, 2),
    clusters: () => [cluster as ClusterInfo],
  } as unknown as MeshInstance;
  const residents = { get: () => ({ group, allocation, arena: {} }) } as unknown as ResidentGroups;
  const distances = (near: number, far: number, side: Side = DoubleSide) => {
    const caster = new Raycaster(new Vector3(0, 0, 0), new Vector3(0, 0, 1), near, far);
    const found: { distance: number }[] = [];
    const sideOf = (material: number) => (material === 7 ? side : DoubleSide);
    castRay(new Object3D(), [instance], residents, sideOf, caster, found as never);
    return found.map(({ distance }) => distance);
  };
  expect(distances(0, 10)).toEqual([2]);
  expect(distances(3, 10)).toEqual([4]);
  expect(distances(3, 3.5)).toEqual([]);
  // The triangles face along the ray.
  expect(distances(0, 10, FrontSide)).toEqual([]);
  expect(distances(0, 10, BackSide)).toEqual([2]);
});
