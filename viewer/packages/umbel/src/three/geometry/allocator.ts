// Hands out ranges of a row of places, the first that is large enough.

export class Allocator {
  /** Free ranges by rising start, none touching the next. */
  private readonly starts: number[];
  private readonly sizes: number[];

  constructor(readonly capacity: number) {
    this.starts = [0];
    this.sizes = [capacity];
  }

  /** The start of `count` places, or -1 if no free range has so many. */
  take(count: number): number {
    const i = this.sizes.findIndex((size) => size >= count);
    if (i < 0) return -1;
    const start = this.starts[i];
    if (this.sizes[i] === count) {
      this.starts.splice(i, 1);
      this.sizes.splice(i, 1);
    } else {
      this.starts[i] += count;
      this.sizes[i] -= count;
    }
    return start;
  }

  give(start: number, count: number): void {
    if (count === 0) return;
    let i = this.starts.findIndex((other) => other > start);
    if (i < 0) i = this.starts.length;
    this.starts.splice(i, 0, start);
    this.sizes.splice(i, 0, count);
    this.join(i);
    if (i > 0) this.join(i - 1);
  }

  get isEmpty(): boolean {
    return this.sizes.length === 1 && this.sizes[0] === this.capacity;
  }

  private join(i: number): void {
    if (this.starts[i] + this.sizes[i] !== this.starts[i + 1]) return;
    this.sizes[i] += this.sizes[i + 1];
    this.starts.splice(i + 1, 1);
    this.sizes.splice(i + 1, 1);
  }
}
