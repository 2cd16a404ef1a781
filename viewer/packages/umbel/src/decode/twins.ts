// Decodes which vertices of a cluster have the position of an earlier vertex of their group, their
// twin, as docs/format.md specifies under "Twins". Vertices are numbered through the group.

import { corrupt } from "../errors.js";
import type { BitReader } from "./bit_reader.js";
import type { SharedVertices } from "./shared_vertices.js";

const NONE = -1;

export class Twins {
  /** For each vertex of the group the earlier one that has its position, or -1. */
  readonly twin: Int32Array;
  /** Whether the last cluster has any. */
  any = false;

  constructor(
    vertices: number,
    private readonly shared: SharedVertices,
  ) {
    this.twin = new Int32Array(vertices).fill(NONE);
  }

  /** Reads those of the last cluster that `shared` has read. */
  read(bits: BitReader): void {
    const { border, lastBorder, next, previous } = this.shared;
    this.any = bits.bit() === 1;
    if (!this.any) return;
    for (let i = lastBorder; i < border.length; ++i) {
      const v = border[i] as number;
      if (this.isKnown(v) || bits.bit() === 0) continue;
      const isOwn = bits.bit() === 1;
      const from = isOwn ? lastBorder : 0;
      const count = isOwn ? i - lastBorder : lastBorder;
      if (count === 0) corrupt("a vertex has the position of none");
      const u = border[from + bits.below(count)] as number;
      this.twin[v] = u;
      this.follow(bits, v, u, next, previous);
      this.follow(bits, v, u, previous, next);
    }
  }

  private isKnown(v: number): boolean {
    return this.twin[v] !== NONE || this.shared.equal[v] !== NONE;
  }

  private follow(bits: BitReader, v: number, u: number, ahead: Int32Array, back: Int32Array): void {
    let w = ahead[v];
    let other = back[u];
    while (w !== NONE && other !== NONE && w !== other) {
      const later = Math.max(w, other);
      if (this.isKnown(later) || bits.bit() === 0) return;
      this.twin[later] = Math.min(w, other);
      w = ahead[w];
      other = back[other];
    }
  }
}
