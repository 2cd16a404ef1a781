// The page's end of a stream: it sends views to a worker and receives geometry.

import { checkNumber, UmbelError } from "../errors.js";
import type { AssetInfo } from "../stream/asset_info.js";
import type { SceneView } from "../stream/instance_stream.js";
import type { StreamListener, StreamOptions, StreamUpdate } from "../stream/stream_update.js";
import type { MeshView } from "../stream/target_cut.js";
import type { FromWorker, ToWorker } from "./messages.js";

export class AssetStream {
  /** Called with each update that arrives before a listener is set. */
  onPreviewUpdate: ((update: StreamUpdate) => void) | undefined;
  /** Number of views and budgets so far; see StreamStatistics. */
  revision = 0;
  private currentListener: StreamListener | undefined;
  /** What arrived before a listener was set. */
  private readonly earlyUpdates: StreamUpdate[] = [];
  private earlyFailure: UmbelError | undefined;
  private readonly files = new Map<number, (answer: Uint8Array | UmbelError) => void>();

  private constructor(
    private readonly worker: Worker,
    readonly info: AssetInfo,
    /** Address of the asset; undefined for a local file. */
    readonly address: string | undefined,
    /** Bytes of memory that the stream was opened with. */
    readonly budget: number,
  ) {}

  /**
   * Opens the asset at an address or in a local file; rejects with an UmbelError.
   * @param onConnection is called when the connection is lost or back before the asset is open
   */
  static async open(
    source: string | Blob,
    options: StreamOptions,
    onConnection?: (isLost: boolean) => void,
  ): Promise<AssetStream> {
    checkNumber("budget", options.budget, true);
    // Not by `instanceof`: other windows have a Blob class of their own.
    const isBlob = typeof source === "object" && source !== null && "arrayBuffer" in source;
    if (typeof source !== "string" && !(isBlob && "slice" in source))
      throw new TypeError("`source` must be an address, as a string, or a Blob.");
    const address = typeof source === "string" ? addressOf(source) : undefined;
    const worker = startWorker();
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
        } else if (data.type === "failed") {
          const error = new UmbelError(data.kind, data.message);
          if (stream) stream.receiveFailure(error);
          else fail(error);
        }
        if (data.type === "update") stream?.receive(data.update);
        else if (data.type === "file") stream?.receiveFile(data.index, data.bytes);
        else if (data.type === "unread")
          stream?.receiveFile(data.index, new UmbelError(data.kind, data.message));
        else if (data.type === "connection" && stream)
          stream.currentListener?.connection(data.isLost);
        else if (data.type === "connection") onConnection?.(data.isLost);
      };
      send(worker, { type: "open", source: address ?? (source as Blob), options });
    });
  }

  /** Receives all updates, those before this call included. */
  set listener(listener: StreamListener) {
    this.currentListener = listener;
    for (const update of this.earlyUpdates.splice(0)) listener.update(update);
    if (this.earlyFailure) listener.failed(this.earlyFailure);
  }

  private receive(update: StreamUpdate): void {
    if (this.currentListener) this.currentListener.update(update);
    else {
      this.earlyUpdates.push(update);
      this.onPreviewUpdate?.(update);
    }
  }

  private receiveFailure(error: UmbelError): void {
    if (this.currentListener) this.currentListener.failed(error);
    else this.earlyFailure = error;
  }

  private receiveFile(index: number, answer: Uint8Array | UmbelError): void {
    const receive = this.files.get(index);
    this.files.delete(index);
    receive?.(answer);
  }

  setViews(views: MeshView[]): void {
    ++this.revision;
    send(this.worker, { type: "views", views });
  }

  /** Of an asset with a tree of instances: selects from it, in place of views of the listed ones. */
  setScene(scene: SceneView): void {
    ++this.revision;
    send(this.worker, { type: "scene", scene });
  }

  setBudget(bytes: number): void {
    checkNumber("budget", bytes, true);
    ++this.revision;
    send(this.worker, { type: "budget", bytes });
  }

  /** While paused, the stream requests nothing more: the page has enough to do. */
  setPaused(isPaused: boolean): void {
    send(this.worker, { type: "pause", isPaused });
  }

  /** Reads an embedded file; rejects with an UmbelError. */
  readFile(index: number, isUrgent = false): Promise<Uint8Array> {
    return new Promise((resolve, reject) => {
      const before = this.files.get(index);
      this.files.set(index, (answer) => {
        before?.(answer);
        if (answer instanceof UmbelError) reject(answer);
        else resolve(answer);
      });
      if (!before) send(this.worker, { type: "file", index, isUrgent });
    });
  }

  close(): void {
    this.worker.onmessage = null;
    this.worker.terminate();
  }
}

function addressOf(source: string): string {
  try {
    // Workers, which may draw to an OffscreenCanvas, have no document.
    return new URL(source, globalThis.document?.baseURI ?? globalThis.location?.href).href;
  } catch {
    throw new UmbelError("missing", `${source} is not an address.`);
  }
}

function startWorker(): Worker {
  try {
    return new Worker(new URL("./stream_worker.js", import.meta.url), { type: "module" });
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    throw new UmbelError("unsupported", `The browser could not start the worker: ${reason}`);
  }
}

function send(worker: Worker, message: ToWorker): void {
  worker.postMessage(message);
}
