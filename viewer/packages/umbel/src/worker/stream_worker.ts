// The worker's end of a stream: it fetches, decodes and selects, to keep the page's thread free.

import { memoryError, UmbelError, type UmbelErrorKind } from "../errors.js";
import { buffersOf } from "../pack/render_group.js";
import { HttpSource } from "../source/http_source.js";
import { BlobSource } from "../source/source.js";
import type { StreamListener } from "../stream/stream_update.js";
import { Streamer } from "../stream/streamer.js";
import type { FromWorker, ToWorker } from "./messages.js";

interface WorkerScope {
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  addEventListener(type: "error", listener: (event: ErrorEvent) => void): void;
  addEventListener(
    type: "unhandledrejection",
    listener: (event: PromiseRejectionEvent) => void,
  ): void;
  postMessage(message: FromWorker, transfer: Transferable[]): void;
}
const scope = globalThis as unknown as WorkerScope;

function send(message: FromWorker, transfer: Transferable[] = []): void {
  scope.postMessage(message, transfer);
}

const listener: StreamListener = {
  update: (update) => {
    const transfer = update.added.flatMap(buffersOf);
    transfer.push(update.pages.buffer as ArrayBuffer);
    for (const { matrices } of update.rows ?? []) transfer.push(matrices.buffer as ArrayBuffer);
    for (const cut of update.cuts ?? []) transfer.push(cut.buffer as ArrayBuffer);
    send({ type: "update", update }, [...new Set(transfer)]);
  },
  connection: (isLost) => send({ type: "connection", isLost }),
  failed: (error) => send({ type: "failed", ...failureOf(error) }),
};

let streamer: Streamer | undefined;

async function open(message: ToWorker & { type: "open" }): Promise<void> {
  const source =
    typeof message.source === "string"
      ? new HttpSource(message.source, { onConnection: listener.connection })
      : new BlobSource(message.source);
  try {
    streamer = await Streamer.open(source, message.options, listener);
    send({ type: "opened", info: streamer.info });
  } catch (error) {
    send({ type: "failed", ...failureOf(error) });
  }
}

function failureOf(error: unknown): { kind: UmbelErrorKind; message: string } {
  const known = memoryError(error) ?? error;
  const kind = known instanceof UmbelError ? known.kind : "corrupt";
  return { kind, message: String(known instanceof Error ? known.message : known) };
}

async function sendFile(from: Streamer, index: number, isUrgent: boolean): Promise<void> {
  try {
    const bytes = await from.readFile(index, isUrgent);
    send({ type: "file", index, bytes }, [bytes.buffer as ArrayBuffer]);
  } catch (error) {
    send({ type: "unread", index, ...failureOf(error) });
  }
}

scope.onmessage = ({ data }) => {
  if (data.type === "open") void open(data);
  else if (data.type === "views") streamer?.setViews(data.views);
  else if (data.type === "budget") streamer?.setBudget(data.bytes);
  else if (data.type === "scene") streamer?.setScene(data.scene);
  else if (data.type === "pause") streamer?.setPaused(data.isPaused);
  else if (data.type === "close") streamer?.close();
  else if (streamer) void sendFile(streamer, data.index, data.isUrgent);
};

// Unexpected errors are reported, too: otherwise the page would wait forever.
scope.addEventListener("error", ({ error }) => send({ type: "failed", ...failureOf(error) }));
scope.addEventListener("unhandledrejection", ({ reason }) =>
  send({ type: "failed", ...failureOf(reason) }),
);
