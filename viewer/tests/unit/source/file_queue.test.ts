import { describe, expect, test } from "vitest";
import { FileQueue } from "../../../packages/umbel/src/source/file_queue.js";

/** A source that answers on demand. */
class SlowSource {
  fetched = 0;
  readonly asked: { offset: number; length: number; answer(): void }[] = [];

  read(offset: number, length: number): Promise<Uint8Array> {
    return new Promise((resolve) => {
      const bytes = Uint8Array.from({ length }, (_, i) => (offset + i) % 251);
      this.asked.push({ offset, length, answer: () => resolve(bytes) });
    });
  }

  close(): void {}
}

const turn = () => new Promise((next) => setTimeout(next, 0));

describe("the file queue", () => {
  test("reads small neighbours in the file by one request", async () => {
    const source = new SlowSource();
    const queue = new FileQueue(
      source,
      () => false,
      () => {},
    );
    const files = [3, 1, 0, 2].map((i) => ({ offset: 10_000 + 3000 * i, size: 2900 }));
    const reads = files.map((file) => queue.read(file, true));
    await turn();
    expect(source.asked.map(({ offset, length }) => [offset, length])).toEqual([[10_000, 11_900]]);
    source.asked[0].answer();
    (await Promise.all(reads)).forEach((bytes, i) => {
      expect(bytes.length).toBe(2900);
      expect(bytes[0]).toBe(files[i].offset % 251);
    });
  });

  test("has two requests at a time, and one while pages are missing", async () => {
    for (const [isBusy, isUrgent, limit] of [
      [false, false, 2],
      [true, false, 1],
      [true, true, 2],
    ] as const) {
      const source = new SlowSource();
      const queue = new FileQueue(
        source,
        () => isBusy,
        () => {},
      );
      const reads = [0, 1, 2, 3].map((i) => queue.read({ offset: 1e7 * i, size: 1e6 }, isUrgent));
      for (let i = 0; i < 4; ++i) {
        await turn();
        expect(queue.requests).toBeLessThanOrEqual(limit);
        expect(source.asked.length).toBe(Math.min(i + limit, 4));
        source.asked[i].answer();
      }
      await Promise.all(reads);
    }
  });

  test("reads urgent files first, and goes on after a failure", async () => {
    const source = new SlowSource();
    const failing = { ...source, read: () => Promise.reject(new Error("gone")) };
    const queue = new FileQueue(
      failing as unknown as SlowSource,
      () => false,
      () => {},
    );
    await expect(queue.read({ offset: 0, size: 10 }, false)).rejects.toThrow("gone");
    expect(queue.requests).toBe(0);
    const ordered = new FileQueue(
      source,
      () => true,
      () => {},
    );
    for (const [i, isUrgent] of [false, false, true].entries())
      void ordered.read({ offset: 1e7 * i, size: 1e6 }, isUrgent);
    await turn();
    expect(source.asked[0].offset).toBe(2e7);
  });
});
