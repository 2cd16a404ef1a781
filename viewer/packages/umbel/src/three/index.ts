// The adapter to three.js.

export {
  type ClusterInfo,
  sphereOf,
  type TintFunction,
  type UmbelIntersection,
  UmbelMesh,
  type UmbelMeshOptions,
} from "./umbel_mesh.js";
