// Reads, decodes, selects and streams .umbel assets.

export type { Attribute, AttributeName, Values } from "./attributes.js";
export { type Bounds, boundsOf } from "./bounds.js";
export { Catalog } from "./catalog.js";
export { UmbelError, type UmbelErrorKind } from "./errors.js";
export { type Json, jsonOf, listOf, numbersOf } from "./gltf.js";
export { type Head, NONE, readHead, readHeader } from "./head.js";
export { bytesPerVertex, packGroup, type RenderGroup } from "./pack.js";
export { type GroupGeometry, type GroupInfo, readPage } from "./page.js";
export { ABSENT, DAMAGED, LOADING, type MeshView, RESIDENT, Residency } from "./residency.js";
export { type CameraView, cameraView, mustRefine, type View } from "./select.js";
export { BlobSource, type ByteSource, type HttpOptions, HttpSource } from "./source.js";
export { AssetStream } from "./stream.js";
export {
  type AssetInfo,
  Streamer,
  type StreamListener,
  type StreamOptions,
  type StreamStatistics,
  type StreamUpdate,
} from "./streamer.js";
