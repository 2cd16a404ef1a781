// The adapter to three.js.

export type { ClusterInfo, TintFunction, UmbelIntersection } from "./cluster_info.js";
export type { TextureStatistics } from "./textures/textures.js";
export { UmbelMesh, type UmbelMeshOptions } from "./umbel_mesh.js";
