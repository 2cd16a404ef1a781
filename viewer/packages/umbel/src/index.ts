// Reads, decodes, selects and streams .umbel assets.

export { type GroupGeometry, type GroupInfo, readPage } from "./decode/page.js";
export { UmbelError, type UmbelErrorKind } from "./errors.js";
export type { Attribute, AttributeName, Values } from "./format/attributes.js";
export { type Head, NONE, readHead, readHeader } from "./format/file_header.js";
export { type Json, jsonOf, listOf, numbersOf } from "./format/gltf.js";
export { Catalog } from "./select/catalog.js";
export { type CameraView, cameraView, mustRefine, type View } from "./select/select.js";
export { type Bounds, boundsOf } from "./stream/bounds.js";
export { bytesPerVertex, packGroup, type RenderGroup } from "./stream/render_group.js";
export {
  ABSENT,
  DAMAGED,
  LOADING,
  type MeshView,
  RESIDENT,
  Residency,
} from "./stream/residency.js";
export { BlobSource, type ByteSource, type HttpOptions, HttpSource } from "./stream/source.js";
export {
  type AssetInfo,
  Streamer,
  type StreamListener,
  type StreamOptions,
  type StreamStatistics,
  type StreamUpdate,
} from "./stream/streamer.js";
export { AssetStream } from "./worker/asset_stream.js";
