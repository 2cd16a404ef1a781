// What a stream's worker and its owner say to each other.

import type { UmbelErrorKind } from "../errors.js";
import type { View } from "../select.js";
import type { AssetInfo, StreamOptions, StreamUpdate } from "../streamer.js";

export type ToWorker =
  | { type: "open"; source: string | Blob; options: StreamOptions }
  | { type: "views"; views: View[] }
  | { type: "budget"; bytes: number }
  | { type: "close" };

export type FromWorker =
  | { type: "opened"; info: AssetInfo }
  | { type: "update"; update: StreamUpdate }
  | { type: "connection"; isLost: boolean }
  | { type: "failed"; kind: UmbelErrorKind; message: string };
