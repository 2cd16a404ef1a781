// The adapter to three.js.

export {
  type ClusterInfo,
  type TintFunction,
  type UmbelIntersection,
  UmbelMesh,
  type UmbelMeshOptions,
} from "./umbel_mesh.js";
