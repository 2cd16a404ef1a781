import { describe, expect, test, vi } from "vitest";
import type { RenderGroup } from "../../../packages/umbel/src/pack/render_group.js";
import type { StreamUpdate } from "../../../packages/umbel/src/stream/stream_update.js";
import { UpdateQueue } from "../../../packages/umbel/src/three/update_queue.js";

/** What a page holds: groups, and those that its cut draws. */
class Page {
  readonly groups = new Set<number>();
  readonly uploaded: number[] = [];
  readonly pages: number[] = [];
  cut: number[] = [];

  add(group: RenderGroup): void {
    if (!this.groups.has(group.group)) this.uploaded.push(group.group);
    this.groups.add(group.group);
  }

  finish(update: StreamUpdate): void {
    for (const group of update.removed) this.groups.delete(group);
    this.pages.push(...update.pages);
    if (update.cuts) this.cut = [...update.cuts[0]];
    for (const group of this.cut) expect(this.groups).toContain(group);
  }
}

function update(added: number[], removed: number[], cut?: number[]): StreamUpdate {
  return {
    added: added.map(
      (group) =>
        ({ group, positions: new Float32Array(3), indices: new Uint32Array(3) }) as RenderGroup,
    ),
    removed,
    cuts: cut && [Uint32Array.from(cut)],
    statistics: { fetchedBytes: added.length } as StreamUpdate["statistics"],
    pages: Uint32Array.from([7, added.length]),
  };
}

/** A clock that each look at moves by so many milliseconds. */
function slowClock(step: number): void {
  let now = 0;
  vi.spyOn(performance, "now").mockImplementation(() => (now += step));
}

describe("updates", () => {
  test("are applied at once while there is time", () => {
    slowClock(0);
    const [queue, page] = [new UpdateQueue(), new Page()];
    queue.push(update([1, 2], [], [1, 2]));
    expect(queue.isEmpty).toBe(false);
    expect(queue.apply(0, page)).toBe(1);
    queue.push(update([3], [1], [2, 3]));
    expect(queue.apply(0, page)).toBe(1);
    expect([...page.groups]).toEqual([2, 3]);
    expect(queue.isEmpty).toBe(true);
  });

  test("take several frames where groups take long, and are shown when all are there", () => {
    slowClock(100);
    const [queue, page] = [new UpdateQueue(), new Page()];
    queue.push(update([1, 2, 3], [], [1, 2, 3]));
    expect(queue.apply(0, page)).toBe(0);
    expect(page.cut).toEqual([]);
    expect(queue.apply(0, page)).toBe(0);
    expect(queue.apply(0, page)).toBe(1);
    expect(page.cut).toEqual([1, 2, 3]);
  });

  test("that wait are merged: what comes and goes is not uploaded", () => {
    slowClock(100);
    const [queue, page] = [new UpdateQueue(), new Page()];
    queue.push(update([1], [], [1]));
    queue.push(update([2], [], [1, 2]));
    queue.push(update([3], [2], [1, 3]));
    queue.push(update([], [3], [1]));
    while (!queue.isEmpty) queue.apply(0, page);
    expect(page.uploaded).toEqual([1]);
    expect([...page.groups]).toEqual([1]);
    expect(page.cut).toEqual([1]);
  });

  test("that are merged tell of all pages, in order, and of the bytes that wait", () => {
    slowClock(100);
    const [queue, page] = [new UpdateQueue(), new Page()];
    for (const groups of [[1], [2], [3, 4]]) queue.push(update(groups, []));
    expect(queue.waitingBytes).toBe(4 * 24);
    queue.apply(0, page);
    expect(queue.waitingBytes).toBe(3 * 24);
    while (!queue.isEmpty) queue.apply(0, page);
    expect(queue.waitingBytes).toBe(0);
    expect(page.pages).toEqual([7, 1, 7, 1, 7, 2]);
  });

  test("a group that is removed and comes back stays, whether it was there or not", () => {
    slowClock(0);
    for (const before of [[1], []]) {
      const [queue, page] = [new UpdateQueue(), new Page()];
      for (const group of before) page.groups.add(group);
      queue.push(update([], []));
      queue.push(update([], [1]));
      queue.push(update([1], [], [1]));
      queue.apply(0, page);
      expect([...page.groups]).toEqual([1]);
      queue.push(update([1], [1], [1]));
      queue.apply(0, page);
      expect([...page.groups]).toEqual([1]);
    }
  });

  test("hold what a stream holds, in any order of coming and going", () => {
    let seed = 1;
    const random = (most: number) => {
      seed = (seed * 48271) % 2147483647;
      return seed % most;
    };
    for (let run = 0; run < 50; ++run) {
      slowClock(random(3) * 10);
      const [queue, page] = [new UpdateQueue(), new Page()];
      const stream = new Set<number>();
      for (let step = 0; step < 60; ++step) {
        const added = new Set<number>();
        const removed = new Set<number>();
        for (let k = random(4); k > 0; --k) {
          const group = random(12);
          if (!stream.delete(group)) {
            stream.add(group);
            added.add(group);
          } else {
            removed.add(group);
            added.delete(group);
          }
        }
        queue.push(update([...added], [...removed], [...stream].slice(0, 3)));
        if (random(3) === 0) queue.apply(0, page);
      }
      while (!queue.isEmpty) queue.apply(0, page);
      expect([...page.groups].sort()).toEqual([...stream].sort());
    }
  });
});
