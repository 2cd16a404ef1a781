// Queues the updates of a stream, so that a frame uploads only as many groups as its time allows.

import type { StreamUpdate } from "../stream/stream_update.js";

/** Milliseconds of a frame for uploads. */
const UPLOAD_TIME = 6;

export class UpdateQueue {
  private readonly updates: StreamUpdate[] = [];

  get isEmpty(): boolean {
    return this.updates.length === 0;
  }

  push(update: StreamUpdate): void {
    this.updates.push(update);
  }

  clear(): void {
    this.updates.length = 0;
  }

  /**
   * Applies one update or more, until the frame's time is used up; returns how many.
   * @param start time at which the frame's work began
   */
  apply(start: number, take: (update: StreamUpdate) => void): number {
    let count = 0;
    while (this.updates.length > 0) {
      if (count > 0 && performance.now() - start > UPLOAD_TIME) break;
      take(this.updates.shift() as StreamUpdate);
      ++count;
    }
    return count;
  }
}
