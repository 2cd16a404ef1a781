// What a stream's worker and its owner say to each other.

import type { UmbelErrorKind } from "../errors.js";
import type { MeshView } from "../stream/residency.js";
import type { AssetInfo, StreamOptions, StreamUpdate } from "../stream/streamer.js";

export type ToWorker =
  | { type: "open"; source: string | Blob; options: StreamOptions }
  | { type: "views"; views: MeshView[] }
  | { type: "budget"; bytes: number }
  | { type: "file"; index: number; isUrgent: boolean }
  | { type: "close" };

export type FromWorker =
  | { type: "opened"; info: AssetInfo }
  | { type: "update"; update: StreamUpdate }
  | { type: "file"; index: number; bytes: Uint8Array | undefined }
  | { type: "connection"; isLost: boolean }
  | { type: "failed"; kind: UmbelErrorKind; message: string };
