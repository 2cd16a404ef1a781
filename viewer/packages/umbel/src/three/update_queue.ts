// Queues the updates of a stream, so that a frame uploads only as many groups as its time allows.
//
// Updates that wait are merged: groups that come and go in the meantime are never uploaded, and what
// waits is no more than what the stream holds, however slow the frames are.

import type { RenderGroup } from "../pack/render_group.js";
import type { StreamUpdate } from "../stream/stream_update.js";

/** Milliseconds of a frame for uploads, at least and at most; between them a share of the frame. */
const UPLOAD_TIME = { low: 6, high: 250 };
const FRAME_SHARE = 0.25;

/** Who takes updates: first each new group, then, in one frame, all else. */
export interface UpdateTarget {
  /** The group may be there already. */
  add(group: RenderGroup): void;
  finish(update: StreamUpdate): void;
}

export class UpdateQueue {
  /** The update whose groups are uploaded now, and what came after it. */
  private current: StreamUpdate | undefined;
  private next: StreamUpdate | undefined;
  private uploaded = 0;
  private lastFrame = 0;

  get isEmpty(): boolean {
    return this.current === undefined;
  }

  /** Bytes of groups that wait, at most. */
  waitingBytes = 0;

  push(update: StreamUpdate): void {
    for (const group of update.added) this.waitingBytes += bytesOf(group);
    if (!this.current) this.current = inOrder(update);
    else this.next = this.next ? merged(this.next, update) : inOrder(update);
  }

  clear(): void {
    this.current = this.next = undefined;
    this.uploaded = this.waitingBytes = 0;
  }

  /**
   * Uploads one group or more, until the frame's time is used up; returns how many updates are done.
   * @param start time at which the frame's work began
   */
  apply(start: number, target: UpdateTarget): number {
    const share = FRAME_SHARE * (start - this.lastFrame);
    const time = Math.min(Math.max(share, UPLOAD_TIME.low), UPLOAD_TIME.high);
    this.lastFrame = start;
    const isLate = () => performance.now() - start > time;
    let count = 0;
    for (let groups = 0; this.current; ) {
      const { added } = this.current;
      for (; this.uploaded < added.length; ++this.uploaded, ++groups) {
        if (groups > 0 && isLate()) return count;
        const bytes = bytesOf(added[this.uploaded]);
        target.add(added[this.uploaded]);
        this.waitingBytes -= bytes;
      }
      target.finish(this.current);
      ++count;
      this.current = this.next;
      this.next = undefined;
      this.uploaded = 0;
      if (isLate()) break;
    }
    if (!this.current) this.waitingBytes = 0;
    return count;
  }
}

function bytesOf({ positions, indices, normals, uvs }: RenderGroup): number {
  const arrays = [positions, indices, normals, uvs];
  return arrays.reduce((sum, array) => sum + (array?.byteLength ?? 0), 0);
}

/** What two updates are together. */
function merged(first: StreamUpdate, second: StreamUpdate): StreamUpdate {
  const added = new Map(first.added.map((group) => [group.group, group]));
  for (const group of second.removed) added.delete(group);
  for (const group of second.added) added.set(group.group, group);
  return inOrder({
    ...second,
    removed: [...new Set([...first.removed, ...second.removed])],
    added: [...added.values()],
    cuts: second.cuts ?? first.cuts,
    rows: second.rows ?? first.rows,
    pages: Uint32Array.from([...first.pages, ...second.pages]),
  });
}

/** Groups are added before others are removed; those that come back are not removed. */
function inOrder(update: StreamUpdate): StreamUpdate {
  const added = new Set(update.added.map(({ group }) => group));
  return { ...update, removed: update.removed.filter((group) => !added.has(group)) };
}
