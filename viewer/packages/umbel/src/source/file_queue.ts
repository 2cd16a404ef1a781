// Reads embedded files: few at a time, so that pages do not wait for images, and neighbours in the
// file by one request.

import type { EmbeddedFile } from "../format/tables.js";
import type { ByteSource } from "./source.js";

const MAX_REQUESTS = 2;
/** Bytes of a request for several files; a larger file has a request of its own. */
const MAX_BYTES = 1 << 18;
/** Bytes between two files that one request may skip. */
const GAP = 1 << 12;

interface Waiting {
  file: EmbeddedFile;
  isUrgent: boolean;
  resolve(bytes: Uint8Array): void;
  reject(error: unknown): void;
}

export class FileQueue {
  /** Number of open requests. */
  requests = 0;
  private readonly waiting: Waiting[] = [];

  /**
   * @param isBusy whether pages are missing: then only one file that is not urgent is read at a time
   * @param onChange is called after each request
   */
  constructor(
    private readonly source: ByteSource,
    private readonly isBusy: () => boolean,
    private readonly onChange: () => void,
  ) {}

  read(file: EmbeddedFile, isUrgent: boolean): Promise<Uint8Array> {
    return new Promise((resolve, reject) => {
      this.waiting.push({ file, isUrgent, resolve, reject });
      // Files that are asked for at the same time may share a request.
      queueMicrotask(() => this.start());
    });
  }

  private start(): void {
    for (;;) {
      const urgent = this.waiting.findIndex(({ isUrgent }) => isUrgent);
      const limit = urgent >= 0 || !this.isBusy() ? MAX_REQUESTS : 1;
      if (this.waiting.length === 0 || this.requests >= limit) return;
      void this.fetch(this.takeRun(Math.max(urgent, 0)));
    }
  }

  /** Removes a waiting file and its neighbours in the file from the queue. */
  private takeRun(at: number): Waiting[] {
    const run = this.waiting.splice(at, 1);
    for (let grows = true; grows; ) {
      const begin = (run[0] as Waiting).file.offset;
      const end = endOf(run);
      const next = this.waiting.findIndex(({ file }) => {
        const bytes = Math.max(end, file.offset + file.size) - Math.min(begin, file.offset);
        const isNear = file.offset + file.size >= begin - GAP && file.offset <= end + GAP;
        return isNear && bytes <= MAX_BYTES;
      });
      grows = next >= 0;
      if (grows) run.push(...this.waiting.splice(next, 1));
      run.sort((a, b) => a.file.offset - b.file.offset);
    }
    return run;
  }

  private async fetch(run: Waiting[]): Promise<void> {
    const begin = (run[0] as Waiting).file.offset;
    ++this.requests;
    try {
      const bytes = await this.source.read(begin, endOf(run) - begin);
      for (const { file, resolve } of run)
        resolve(bytes.slice(file.offset - begin, file.offset - begin + file.size));
    } catch (error) {
      for (const { reject } of run) reject(error);
    }
    --this.requests;
    this.onChange();
    this.start();
  }
}

function endOf(run: readonly Waiting[]): number {
  return run.reduce((end, { file }) => Math.max(end, file.offset + file.size), 0);
}
