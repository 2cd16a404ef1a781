// A priority queue of numbers: a binary heap.

export class PriorityQueue {
  private readonly priorities: number[] = [];
  private readonly values: number[] = [];

  push(priority: number, value: number): void {
    let i = this.values.length;
    this.priorities.push(priority);
    this.values.push(value);
    while (i > 0) {
      const parent = (i - 1) >> 1;
      if (this.priorities[parent] >= priority) break;
      this.swap(i, parent);
      i = parent;
    }
  }

  /** Removes the value of the highest priority; undefined if there is none. */
  pop(): { priority: number; value: number } | undefined {
    const last = this.values.length - 1;
    if (last < 0) return undefined;
    this.swap(0, last);
    const value = this.values.pop() as number;
    const priority = this.priorities.pop() as number;
    for (let i = 0; ; ) {
      let child = 2 * i + 1;
      if (child >= last) break;
      if (child + 1 < last && this.priorities[child + 1] > this.priorities[child]) ++child;
      if (this.priorities[child] <= this.priorities[i]) break;
      this.swap(i, child);
      i = child;
    }
    return { priority, value };
  }

  private swap(a: number, b: number): void {
    [this.priorities[a], this.priorities[b]] = [this.priorities[b], this.priorities[a]];
    [this.values[a], this.values[b]] = [this.values[b], this.values[a]];
  }
}
