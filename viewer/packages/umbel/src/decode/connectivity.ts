// The triangles of a cluster: a walk from triangle to triangle across edges, as docs/format.md
// describes it under "A cluster's data".

import { corrupt } from "../errors.js";
import type { BitReader } from "./bit_reader.js";

const MAX_VERTICES = 256;
const MAX_GATES = 3 * 256;
const NO_GATE = 0xffff;

const NEW = 0;
const FROM = 1;
const INTO = 2;
const NAMED = 3;
const NOTHING = 4;

/** What each word of the code says, by its bits as they are read. */
const WORDS: readonly [string, number, number, number][] = [
  ["1", NEW, 1, 1],
  ["011", FROM, 1, 1],
  ["010", INTO, 1, 1],
  ["0011", NEW, 0, 1],
  ["0010", NEW, 1, 0],
  ["00011", NEW, 0, 0],
  ["00010", FROM, 1, 0],
  ["00001", INTO, 0, 1],
  ["000001", NAMED, 1, 1],
  ["00000011", NAMED, 0, 1],
  ["00000010", NAMED, 1, 0],
  ["00000001", NAMED, 0, 0],
  ["00000000", NOTHING, 0, 0],
];
/** For each next eight bits: length of the word, apex, right, left, in 4, 3, 1 and 1 bits. */
const TABLE = new Uint16Array(256);
for (const [word, apex, right, left] of WORDS) {
  const low = [...word].reduce((sum, bit, i) => sum | (Number(bit) << i), 0);
  for (let high = 0; high < 1 << (8 - word.length); ++high)
    TABLE[low | (high << word.length)] = word.length | (apex << 4) | (right << 7) | (left << 8);
}

/** Decodes one cluster after another; keeps its scratch memory between them. */
export class TriangleDecoder {
  /** For each vertex of the last cluster: the three that it is predicted from (a, b, across). */
  readonly parents = new Uint8Array(3 * MAX_VERTICES);
  /** The border edges of the last cluster, from and to, in the order of the walk. */
  readonly border = new Uint8Array(2 * MAX_GATES);
  borderEdges = 0;

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
    this.borderEdges = 0;
    this.from.fill(NO_GATE);
    this.into.fill(NO_GATE);
    let first = 0;
    const end = at + 3 * triangles;
    while (at < end) {
      while (first < this.opened && this.gateOpen[first] === 0) ++first;
      let a: number;
      let b: number;
      let c: number;
      let right: number;
      let left: number;
      if (first < this.opened) {
        const gate = first++;
        this.forget(gate);
        const word = TABLE[bits.peek() & 0xff];
        bits.at += word & 15;
        const apex = (word >> 4) & 7;
        if (apex === NOTHING) continue;
        a = this.gateA[gate];
        b = this.gateB[gate];
        c = this.apex(apex, gate);
        right = (word >> 7) & 1;
        left = word >> 8;
      } else {
        a = this.corner();
        b = this.corner();
        c = this.corner();
        this.pass(a, b, c, bits.take(1));
        right = -1;
        left = -1;
      }
      out[at] = base + a;
      out[at + 1] = base + b;
      out[at + 2] = base + c;
      at += 3;
      this.pass(b, c, a, right < 0 ? bits.take(1) : right);
      this.pass(c, a, b, left < 0 ? bits.take(1) : left);
    }
    while (this.seen < vertices) this.numberAfterLast();
  }

  private number(a: number, b: number, across: number): number {
    if (this.seen >= this.vertices) corrupt("a cluster's triangles have more vertices than it has");
    const vertex = this.seen++;
    this.parents[3 * vertex] = a;
    this.parents[3 * vertex + 1] = b;
    this.parents[3 * vertex + 2] = across;
    return vertex;
  }

  private numberAfterLast(): number {
    const before = Math.max(this.seen, 1) - 1;
    return this.number(before, before, before);
  }

  private corner(): number {
    return this.bits.take(1) ? this.numberAfterLast() : this.bits.below(this.seen);
  }

  private apex(kind: number, gate: number): number {
    const a = this.gateA[gate];
    const b = this.gateB[gate];
    if (kind === NEW) return this.number(a, b, this.gateAcross[gate]);
    if (kind === NAMED) return this.bits.below(this.seen);
    const other = kind === FROM ? this.from[b] : this.into[a];
    if (other === NO_GATE) corrupt("a triangle leans on a gate that is not there");
    return kind === FROM ? this.gateB[other] : this.gateA[other];
  }

  private forget(gate: number): void {
    const a = this.gateA[gate];
    const b = this.gateB[gate];
    if (this.from[a] === gate) this.from[a] = NO_GATE;
    if (this.into[b] === gate) this.into[b] = NO_GATE;
  }

  /** Passes the edge from x to y, opposite to w. */
  private pass(x: number, y: number, w: number, isGate: number): void {
    let gate = this.from[x];
    if (gate === NO_GATE || this.gateB[gate] !== y) gate = this.into[y];
    if (gate !== NO_GATE && this.gateA[gate] === x) {
      this.gateOpen[gate] = 0;
      this.forget(gate);
    } else if (isGate) {
      const opened = this.opened++;
      this.from[y] = opened;
      this.into[x] = opened;
      this.gateA[opened] = y;
      this.gateB[opened] = x;
      this.gateAcross[opened] = w;
      this.gateOpen[opened] = 1;
    } else {
      const edge = this.borderEdges++;
      this.border[2 * edge] = x;
      this.border[2 * edge + 1] = y;
    }
  }
}
