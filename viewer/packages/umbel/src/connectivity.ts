// The triangles of a cluster: a walk from triangle to triangle across edges, as docs/format.md
// describes it under "A cluster's data".

import type { BitReader } from "./bits.js";
import { corrupt } from "./errors.js";

const MAX_VERTICES = 256;
const MAX_GATES = 3 * 256;
const NO_GATE = 0xffff;

const NEW = 0;
const AFTER = 1;
const BEFORE = 2;
const NAMED = 3;
const NOTHING = 4;

/** Bits of a number below `count`. */
function bitsBelow(count: number): number {
  return count < 2 ? 0 : 32 - Math.clz32(count - 1);
}

/** Decodes one cluster after another; keeps its scratch memory between them. */
export class TriangleDecoder {
  /** For each vertex of the last cluster: the three that it is predicted from (a, b, across). */
  readonly parents = new Uint8Array(3 * MAX_VERTICES);

  private readonly gateA = new Uint8Array(MAX_GATES);
  private readonly gateB = new Uint8Array(MAX_GATES);
  private readonly gateAcross = new Uint8Array(MAX_GATES);
  private readonly gateOpen = new Uint8Array(MAX_GATES);
  private readonly from = new Uint16Array(MAX_VERTICES);
  private readonly into = new Uint16Array(MAX_VERTICES);
  private opened = 0;
  private seen = 0;
  private vertices = 0;
  private bits!: BitReader;

  /** Writes 3 * `triangles` vertex numbers, each with `base` added, to `out` at `at`. */
  decode(
    bits: BitReader,
    vertices: number,
    triangles: number,
    out: Uint32Array,
    at: number,
    base: number,
  ): void {
    this.bits = bits;
    this.vertices = vertices;
    this.opened = 0;
    this.seen = 0;
    this.from.fill(NO_GATE);
    this.into.fill(NO_GATE);
    let first = 0;
    const end = at + 3 * triangles;
    while (at < end) {
      while (first < this.opened && this.gateOpen[first] === 0) ++first;
      let a: number;
      let b: number;
      let c: number;
      if (first < this.opened) {
        const gate = first++;
        this.forget(gate);
        const apex = bits.zeros(NOTHING);
        if (apex === NOTHING) continue;
        a = this.gateA[gate];
        b = this.gateB[gate];
        c = this.apex(apex, gate);
      } else {
        a = this.corner();
        b = this.corner();
        c = this.corner();
        this.pass(a, b, c);
      }
      out[at] = base + a;
      out[at + 1] = base + b;
      out[at + 2] = base + c;
      at += 3;
      this.pass(b, c, a);
      this.pass(c, a, b);
    }
    while (this.seen < vertices) this.numberAtStart();
  }

  private number(a: number, b: number, across: number): number {
    if (this.seen >= this.vertices) corrupt("a cluster's triangles have more vertices than it has");
    const vertex = this.seen++;
    this.parents[3 * vertex] = a;
    this.parents[3 * vertex + 1] = b;
    this.parents[3 * vertex + 2] = across;
    return vertex;
  }

  private numberAtStart(): number {
    const before = Math.max(this.seen, 1) - 1;
    return this.number(before, before, before);
  }

  private named(): number {
    const vertex = this.bits.take(bitsBelow(this.seen));
    if (vertex >= this.seen) corrupt(`a triangle has the local vertex ${vertex} of ${this.seen}`);
    return vertex;
  }

  private corner(): number {
    return this.bits.take(1) ? this.numberAtStart() : this.named();
  }

  private apex(kind: number, gate: number): number {
    const a = this.gateA[gate];
    const b = this.gateB[gate];
    if (kind === NEW) return this.number(a, b, this.gateAcross[gate]);
    if (kind === NAMED) return this.named();
    const other = kind === AFTER ? this.from[b] : kind === BEFORE ? this.into[a] : NO_GATE;
    if (other === NO_GATE) corrupt("a triangle leans on a gate that is not there");
    return kind === AFTER ? this.gateB[other] : this.gateA[other];
  }

  private forget(gate: number): void {
    const a = this.gateA[gate];
    const b = this.gateB[gate];
    if (this.from[a] === gate) this.from[a] = NO_GATE;
    if (this.into[b] === gate) this.into[b] = NO_GATE;
  }

  /** Passes the edge from x to y, opposite to w. */
  private pass(x: number, y: number, w: number): void {
    let gate = this.from[x];
    if (gate === NO_GATE || this.gateB[gate] !== y) gate = this.into[y];
    if (gate !== NO_GATE && this.gateA[gate] === x) {
      this.gateOpen[gate] = 0;
      this.forget(gate);
    } else if (this.bits.take(1)) {
      const opened = this.opened++;
      this.from[y] = opened;
      this.into[x] = opened;
      this.gateA[opened] = y;
      this.gateB[opened] = x;
      this.gateAcross[opened] = w;
      this.gateOpen[opened] = 1;
    }
  }
}
