// The worker of a stream: fetches, decodes and selects, so that the page stays smooth.

import { UmbelError } from "../errors.js";
import { buffersOf } from "../stream/render_group.js";
import { BlobSource, HttpSource } from "../stream/source.js";
import { Streamer, type StreamListener } from "../stream/streamer.js";
import type { FromWorker, ToWorker } from "./messages.js";

interface WorkerScope {
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  postMessage(message: FromWorker, transfer: Transferable[]): void;
}
const scope = globalThis as unknown as WorkerScope;

function say(message: FromWorker, transfer: Transferable[] = []): void {
  scope.postMessage(message, transfer);
}

const listener: StreamListener = {
  update: (update) => {
    const transfer = update.added.flatMap(buffersOf);
    for (const cut of update.cuts ?? []) transfer.push(cut.buffer as ArrayBuffer);
    say({ type: "update", update }, [...new Set(transfer)]);
  },
  connection: (isLost) => say({ type: "connection", isLost }),
};

let streamer: Streamer | undefined;

async function open(message: ToWorker & { type: "open" }): Promise<void> {
  const source =
    typeof message.source === "string"
      ? new HttpSource(message.source, { onConnection: listener.connection })
      : new BlobSource(message.source);
  try {
    streamer = await Streamer.open(source, message.options, listener);
    say({ type: "opened", info: streamer.info });
  } catch (error) {
    const kind = error instanceof UmbelError ? error.kind : "corrupt";
    say({ type: "failed", kind, message: String(error instanceof Error ? error.message : error) });
  }
}

async function sendFile(index: number, isUrgent: boolean): Promise<void> {
  try {
    const bytes = await streamer?.readFile(index, isUrgent);
    say({ type: "file", index, bytes }, bytes ? [bytes.buffer as ArrayBuffer] : []);
  } catch {
    say({ type: "file", index, bytes: undefined });
  }
}

scope.onmessage = ({ data }) => {
  if (data.type === "open") void open(data);
  else if (data.type === "views") streamer?.setViews(data.views);
  else if (data.type === "budget") streamer?.setBudget(data.bytes);
  else if (data.type === "file") void sendFile(data.index, data.isUrgent);
  else streamer?.close();
};
