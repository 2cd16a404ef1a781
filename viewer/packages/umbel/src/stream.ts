// A stream as the page sees it: a worker that is told what is seen and answers with geometry.

import { UmbelError } from "./errors.js";
import type { View } from "./select.js";
import type { AssetInfo, StreamListener, StreamOptions } from "./streamer.js";
import type { FromWorker, ToWorker } from "./worker/messages.js";

export class AssetStream {
  private constructor(
    private readonly worker: Worker,
    readonly info: AssetInfo,
  ) {}

  /**
   * Opens the asset at an address or in a local file; rejects with an UmbelError. Geometry comes to
   * the listener once views are set.
   */
  static open(
    source: string | Blob,
    options: StreamOptions,
    listener: StreamListener,
  ): Promise<AssetStream> {
    const worker = new Worker(new URL("./worker/stream_worker.js", import.meta.url), {
      type: "module",
    });
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
          resolve(new AssetStream(worker, data.info));
        } else if (data.type === "failed") fail(new UmbelError(data.kind, data.message));
        else if (data.type === "update") listener.update(data.update);
        else listener.connection(data.isLost);
      };
      const address = typeof source === "string" ? new URL(source, document.baseURI).href : source;
      send(worker, { type: "open", source: address, options });
    });
  }

  setViews(views: View[]): void {
    send(this.worker, { type: "views", views });
  }

  setBudget(bytes: number): void {
    send(this.worker, { type: "budget", bytes });
  }

  close(): void {
    this.worker.onmessage = null;
    this.worker.terminate();
  }
}

function send(worker: Worker, message: ToWorker): void {
  worker.postMessage(message);
}
