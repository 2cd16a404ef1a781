// The messages between the page and a stream's worker.

import type { UmbelErrorKind } from "../errors.js";
import type { AssetInfo } from "../stream/asset_info.js";
import type { SceneView } from "../stream/instance_stream.js";
import type { StreamOptions, StreamUpdate } from "../stream/stream_update.js";
import type { MeshView } from "../stream/target_cut.js";

export type ToWorker =
  | { type: "open"; source: string | Blob; options: StreamOptions }
  | { type: "views"; views: MeshView[] }
  | { type: "scene"; scene: SceneView }
  | { type: "budget"; bytes: number }
  | { type: "pause"; isPaused: boolean }
  | { type: "file"; index: number; isUrgent: boolean }
  | { type: "close" };

export type FromWorker =
  | { type: "opened"; info: AssetInfo }
  | { type: "update"; update: StreamUpdate }
  | { type: "file"; index: number; bytes: Uint8Array }
  | { type: "unread"; index: number; kind: UmbelErrorKind; message: string }
  | { type: "connection"; isLost: boolean }
  | { type: "failed"; kind: UmbelErrorKind; message: string };
