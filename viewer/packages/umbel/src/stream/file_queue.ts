// Reads embedded files beside the geometry: few at a time, so that pages never wait for pictures,
// and those that lie beside each other in the file by one request.

import type { EmbeddedFile } from "../format/file_header.js";
import type { ByteSource } from "./source.js";

const REQUESTS = 2;
/** What small files are joined to, at most; a larger one is asked for by itself. */
const MOST_BYTES = 1 << 18;
/** Bytes between two files that are worth one request. */
const GAP = 1 << 12;

interface Waiting {
  file: EmbeddedFile;
  isUrgent: boolean;
  resolve(bytes: Uint8Array): void;
  reject(error: unknown): void;
}

export class FileQueue {
  /** Requests that are under way. */
  requests = 0;
  private readonly waiting: Waiting[] = [];

  /**
   * @param isBusy whether geometry is missing: then files that are not urgent come one at a time
   * @param onChange is told when a request has begun or ended
   */
  constructor(
    private readonly source: ByteSource,
    private readonly isBusy: () => boolean,
    private readonly onChange: () => void,
  ) {}

  read(file: EmbeddedFile, isUrgent: boolean): Promise<Uint8Array> {
    return new Promise((resolve, reject) => {
      this.waiting.push({ file, isUrgent, resolve, reject });
      // What is asked for at the same time may go together.
      queueMicrotask(() => this.start());
    });
  }

  private start(): void {
    for (;;) {
      const urgent = this.waiting.findIndex(({ isUrgent }) => isUrgent);
      const most = urgent >= 0 || !this.isBusy() ? REQUESTS : 1;
      if (this.waiting.length === 0 || this.requests >= most) return;
      void this.fetch(this.run(Math.max(urgent, 0)));
    }
  }

  /** Takes one that waits, with those that lie right behind it or before it. */
  private run(at: number): Waiting[] {
    const run = this.waiting.splice(at, 1);
    for (let grows = true; grows; ) {
      const begin = (run[0] as Waiting).file.offset;
      const end = endOf(run);
      const next = this.waiting.findIndex(({ file }) => {
        const bytes = Math.max(end, file.offset + file.size) - Math.min(begin, file.offset);
        const isNear = file.offset + file.size >= begin - GAP && file.offset <= end + GAP;
        return isNear && bytes <= MOST_BYTES;
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
