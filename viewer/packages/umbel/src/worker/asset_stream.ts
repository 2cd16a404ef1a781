// A stream as the page sees it: a worker that is told what is seen and answers with geometry.

import { UmbelError } from "../errors.js";
import type { MeshView } from "../stream/residency.js";
import type { AssetInfo, StreamListener, StreamOptions, StreamUpdate } from "../stream/streamer.js";
import type { FromWorker, ToWorker } from "./messages.js";

export class AssetStream {
  /** Told of what arrives while there is no listener yet. */
  preview: ((update: StreamUpdate) => void) | undefined;
  private listening: StreamListener | undefined;
  private readonly waiting: StreamUpdate[] = [];
  private readonly files = new Map<number, (bytes: Uint8Array | undefined) => void>();

  private constructor(
    private readonly worker: Worker,
    readonly info: AssetInfo,
    /** Where the asset is; undefined for a local file. */
    readonly address: string | undefined,
    /** Bytes of memory that it was opened with. */
    readonly budget: number,
  ) {}

  /** Opens the asset at an address or in a local file; rejects with an UmbelError. */
  static open(source: string | Blob, options: StreamOptions): Promise<AssetStream> {
    const worker = new Worker(new URL("./stream_worker.js", import.meta.url), {
      type: "module",
    });
    const address = typeof source === "string" ? new URL(source, document.baseURI).href : undefined;
    let stream: AssetStream | undefined;
    return new Promise((resolve, reject) => {
      const fail = (error: UmbelError) => {
        worker.terminate();
        reject(error);
      };
      worker.onerror = () =>
        fail(new UmbelError("unsupported", "The browser could not start the viewer's worker."));
      worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
        if (data.type === "opened") {
          worker.onerror = null;
          stream = new AssetStream(worker, data.info, address, options.budget);
          resolve(stream);
        } else if (data.type === "failed") fail(new UmbelError(data.kind, data.message));
        else if (data.type === "update") stream?.receive(data.update);
        else if (data.type === "file") stream?.receiveFile(data.index, data.bytes);
        else stream?.listening?.connection(data.isLost);
      };
      send(worker, { type: "open", source: address ?? (source as Blob), options });
    });
  }

  /** Who is told what arrives, once views are set, and what has arrived before. */
  set listener(listener: StreamListener) {
    this.listening = listener;
    for (const update of this.waiting.splice(0)) listener.update(update);
  }

  private receive(update: StreamUpdate): void {
    if (this.listening) this.listening.update(update);
    else {
      this.waiting.push(update);
      this.preview?.(update);
    }
  }

  private receiveFile(index: number, bytes: Uint8Array | undefined): void {
    const tell = this.files.get(index);
    this.files.delete(index);
    tell?.(bytes);
  }

  setViews(views: MeshView[]): void {
    send(this.worker, { type: "views", views });
  }

  setBudget(bytes: number): void {
    send(this.worker, { type: "budget", bytes });
  }

  /** The bytes of an embedded file; undefined if it could not be read. */
  readFile(index: number, isUrgent = false): Promise<Uint8Array | undefined> {
    return new Promise((resolve) => {
      const before = this.files.get(index);
      this.files.set(index, (bytes) => {
        before?.(bytes);
        resolve(bytes);
      });
      if (!before) send(this.worker, { type: "file", index, isUrgent });
    });
  }

  close(): void {
    this.worker.onmessage = null;
    this.worker.terminate();
  }
}

function send(worker: Worker, message: ToWorker): void {
  worker.postMessage(message);
}
