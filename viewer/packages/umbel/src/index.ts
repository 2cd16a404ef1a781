// Reads, decodes, selects and streams .umbel assets.

export type { Values } from "./decode/attribute_values.js";
export type { GroupGeometry, GroupInfo } from "./decode/group.js";
export { readPage } from "./decode/page.js";
export { loadWasm } from "./decode/wasm_decoder.js";
export { UmbelError, type UmbelErrorKind } from "./errors.js";
export type { Attribute, AttributeName } from "./format/attributes.js";
export { type FileHeader, NONE, readFileHeader } from "./format/file_header.js";
export { type Json, jsonOf, listOf, numbersOf } from "./format/gltf.js";
export { readFixedHeader } from "./format/sections.js";
export { bytesPerVertex, packGroup, type RenderGroup } from "./pack/render_group.js";
export { GroupDag } from "./select/group_dag.js";
export { type CameraView, cameraView, mustRefine, type View } from "./select/select.js";
export { type HttpOptions, HttpSource } from "./source/http_source.js";
export { BlobSource, type ByteSource } from "./source/source.js";
export type { AssetInfo } from "./stream/asset_info.js";
export { type Bounds, boundsOf } from "./stream/bounds.js";
export { ABSENT, DAMAGED, LOADING, RESIDENT } from "./stream/page_cache.js";
export { Residency } from "./stream/residency.js";
export type {
  StreamListener,
  StreamOptions,
  StreamStatistics,
  StreamUpdate,
} from "./stream/stream_update.js";
export { Streamer } from "./stream/streamer.js";
export type { MeshView } from "./stream/target_cut.js";
export { AssetStream } from "./worker/asset_stream.js";
