// Decodes which vertices of a cluster are equal to vertices of earlier clusters in its group, as
// docs/format.md specifies under "What is shared". Vertices are numbered through the group.

import type { BitReader } from "./bit_reader.js";
import { border as borderOfCluster } from "./connectivity.js";

const NONE = -1;

export class SharedVertices {
  /** For each vertex of the group the earlier one that it is equal to, or -1. */
  readonly equal: Int32Array;
  /** The next and the previous vertex along the border of its cluster, or -1. */
  readonly next: Int32Array;
  readonly previous: Int32Array;
  /** Border vertices of all clusters so far; those of the last begin at `lastBorder`. */
  readonly border: number[] = [];
  lastBorder = 0;

  constructor(vertices: number) {
    this.equal = new Int32Array(vertices).fill(NONE);
    this.next = new Int32Array(vertices).fill(NONE);
    this.previous = new Int32Array(vertices).fill(NONE);
  }

  /** Reads the shared vertices of the last cluster: its vertices begin at `first`, and it has so
   * many border edges. */
  read(bits: BitReader, borderEdges: number, first: number, count: number): void {
    const { next, previous, border } = this;
    for (let i = 0; i < borderEdges; ++i) {
      const x = first + borderOfCluster[2 * i];
      const y = first + borderOfCluster[2 * i + 1];
      next[x] = y;
      previous[y] = x;
    }
    if (bits.bit() === 1)
      for (let v = first; v < first + count; ++v)
        if (this.isBorder(v) && this.equal[v] === NONE && bits.bit() !== 0) {
          const u = border[bits.below(border.length)] as number;
          this.equal[v] = u;
          this.follow(bits, v, u, next, previous);
          this.follow(bits, v, u, previous, next);
        }
    this.lastBorder = border.length;
    for (let v = first; v < first + count; ++v) if (this.isBorder(v)) border.push(v);
  }

  private isBorder(v: number): boolean {
    return this.next[v] !== NONE || this.previous[v] !== NONE;
  }

  /** Shares further vertices along both borders, which run in opposite directions, while a bit is 1. */
  private follow(bits: BitReader, v: number, u: number, ahead: Int32Array, back: Int32Array): void {
    const { equal } = this;
    let w = ahead[v];
    let other = back[u];
    while (w !== NONE && other !== NONE && equal[w] === NONE && bits.bit()) {
      equal[w] = other;
      w = ahead[w];
      other = back[other];
    }
  }
}
