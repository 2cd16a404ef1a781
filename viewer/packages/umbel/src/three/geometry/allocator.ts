// Allocates ranges of an array: the first free range that is large enough.

export class Allocator {
  /** Free ranges by rising start; neighbours are merged. */
  private readonly starts: number[];
  private readonly sizes: number[];

  constructor(readonly capacity: number) {
    this.starts = [0];
    this.sizes = [capacity];
  }

  /** Allocates `count` elements; returns their start, or -1 if no free range is large enough. */
  allocate(count: number): number {
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

  /** Whether `allocate` would find a range. */
  fits(count: number): boolean {
    return this.sizes.some((size) => size >= count);
  }

  free(start: number, count: number): void {
    if (count === 0) return;
    let i = this.starts.findIndex((other) => other > start);
    if (i < 0) i = this.starts.length;
    this.starts.splice(i, 0, start);
    this.sizes.splice(i, 0, count);
    this.merge(i);
    if (i > 0) this.merge(i - 1);
  }

  get isEmpty(): boolean {
    return this.sizes.length === 1 && this.sizes[0] === this.capacity;
  }

  private merge(i: number): void {
    if (this.starts[i] + this.sizes[i] !== this.starts[i + 1]) return;
    this.sizes[i] += this.sizes[i + 1];
    this.starts.splice(i + 1, 1);
    this.sizes.splice(i + 1, 1);
  }
}
