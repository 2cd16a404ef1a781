// A queue that gives out what is most urgent first.

export class Heap {
  private readonly urgencies: number[] = [];
  private readonly values: number[] = [];

  push(urgency: number, value: number): void {
    let i = this.values.length;
    this.urgencies.push(urgency);
    this.values.push(value);
    while (i > 0) {
      const parent = (i - 1) >> 1;
      if (this.urgencies[parent] >= urgency) break;
      this.swap(i, parent);
      i = parent;
    }
  }

  /** The most urgent value and how urgent it is; undefined if there is none. */
  pop(): { urgency: number; value: number } | undefined {
    const last = this.values.length - 1;
    if (last < 0) return undefined;
    this.swap(0, last);
    const value = this.values.pop() as number;
    const urgency = this.urgencies.pop() as number;
    for (let i = 0; ; ) {
      let child = 2 * i + 1;
      if (child >= last) break;
      if (child + 1 < last && this.urgencies[child + 1] > this.urgencies[child]) ++child;
      if (this.urgencies[child] <= this.urgencies[i]) break;
      this.swap(i, child);
      i = child;
    }
    return { urgency, value };
  }

  private swap(a: number, b: number): void {
    [this.urgencies[a], this.urgencies[b]] = [this.urgencies[b], this.urgencies[a]];
    [this.values[a], this.values[b]] = [this.values[b], this.values[a]];
  }
}
