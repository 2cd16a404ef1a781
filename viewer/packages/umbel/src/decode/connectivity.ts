// Decodes the triangles of a cluster, in the manner of Edgebreaker (Rossignac, "Edgebreaker:
// Connectivity Compression for Triangle Meshes", 1999). The decoder grows the surface from triangle
// to triangle across a queue of active edges: directed edges with a triangle on the far side.
// docs/format.md specifies every bit, under "A cluster's data".

import { corrupt } from "../errors.js";
import type { BitReader } from "./bit_reader.js";

const MAX_VERTICES = 256;
const MAX_EDGES = 3 * 256;
const NO_EDGE = 0xffff;

/** Where the apex of the triangle across an active edge (a, b) comes from: a row of CODES. */
const NEW = 0;
const END_OF_OUTGOING = 1;
const EXPLICIT = 3;
const NO_TRIANGLE = 4;

/** Prefix codes by apex: where neither edge is active, the right one, the left one, or both. */
const WORDS = [
  ["00011", "0010", "0011", "1"], // a new vertex
  ["", "00010", "", "011"], // the end of the outgoing edge
  ["", "", "00001", "010"], // the start of the incoming edge
  ["00000001", "00000010", "00000011", "000001"], // explicit
  ["00000000", "", "", ""], // no triangle
];
/** The same for clusters of many small regions. */
const BORDER_WORDS = [
  ["01", "10", "11", "001"],
  ["", "000010", "", "000011"],
  ["", "", "00010", "00011"],
  ["0000001", "0000010", "0000011", "00000001"],
  ["00000000", "", "", ""],
];

/** By the next eight bits: length of the code, apex, right and left, in 4, 3, 1 and 1 bits. */
function tableOf(words: readonly (readonly string[])[]): Uint16Array {
  const table = new Uint16Array(256);
  for (const [apex, codes] of words.entries()) {
    for (const [edges, code] of codes.entries()) {
      if (code === "") continue;
      const low = [...code].reduce((sum, bit, i) => sum | (Number(bit) << i), 0);
      for (let high = 0; high < 1 << (8 - code.length); ++high)
        table[low | (high << code.length)] = code.length | (apex << 4) | (edges << 7);
    }
  }
  return table;
}
const TABLES = [tableOf(WORDS), tableOf(BORDER_WORDS)] as const;

// Arrays are scratch memory of the module: engines address those faster than what an object has.
/** For each vertex of the last cluster the three that predict it: a, b and the opposite one. */
export const predictors = new Uint8Array(3 * MAX_VERTICES);
/** Whether it is the last of three new vertices that a region starts with: 0 or 1. */
export const closes = new Uint8Array(MAX_VERTICES);
/** The border edges of the last cluster, start and end, in the order of decoding. */
export const border = new Uint8Array(2 * MAX_EDGES);

const edgeStart = new Uint8Array(MAX_EDGES);
const edgeEnd = new Uint8Array(MAX_EDGES);
const edgeOpposite = new Uint8Array(MAX_EDGES);
const isActive = new Uint8Array(MAX_EDGES);
/** The last active edge that starts, or ends, at each vertex. */
const outgoing = new Uint16Array(MAX_VERTICES);
const incoming = new Uint16Array(MAX_VERTICES);

/** Decodes one cluster after another. */
export class TriangleDecoder {
  borderEdges = 0;
  private edges = 0;
  private vertices = 0;
  private vertexLimit = 0;
  private bits!: BitReader;

  /** Writes 3 * `triangles` vertex numbers, each with `base` added, to `out` at `at`. `version` is
   * that of the file format. */
  decode(
    version: number,
    bits: BitReader,
    vertices: number,
    triangles: number,
    out: Uint32Array,
    at: number,
    base: number,
  ): void {
    this.bits = bits;
    this.vertexLimit = vertices;
    this.edges = 0;
    this.vertices = 0;
    this.borderEdges = 0;
    outgoing.fill(NO_EDGE);
    incoming.fill(NO_EDGE);
    let first = 0;
    const end = at + 3 * triangles;
    const table = version > 5 && bits.bit() === 1 ? TABLES[1] : TABLES[0];
    while (at < end) {
      while (first < this.edges && isActive[first] === 0) ++first;
      let a: number;
      let b: number;
      let c: number;
      let right: number;
      let left: number;
      if (first < this.edges) {
        const edge = first++;
        this.unlink(edge);
        const code = table[bits.peek() & 0xff];
        bits.at += code & 15;
        const apex = (code >> 4) & 7;
        if (apex === NO_TRIANGLE) continue;
        a = edgeStart[edge];
        b = edgeEnd[edge];
        c = this.readApex(apex, edge);
        right = (code >> 7) & 1;
        left = code >> 8;
      } else {
        const areNew = version > 5 && bits.bit() === 1;
        a = areNew ? this.addVertexAfterLast() : this.readVertex();
        b = areNew ? this.addVertexAfterLast() : this.readVertex();
        c = areNew ? this.addVertexAfterLast() : this.readVertex();
        if (areNew) closes[c] = 1;
        this.finishEdge(a, b, c, bits.bit());
        right = -1;
        left = -1;
      }
      out[at] = base + a;
      out[at + 1] = base + b;
      out[at + 2] = base + c;
      at += 3;
      this.finishEdge(b, c, a, right < 0 ? bits.bit() : right);
      this.finishEdge(c, a, b, left < 0 ? bits.bit() : left);
    }
    while (this.vertices < vertices) this.addVertexAfterLast();
  }

  private addVertex(a: number, b: number, opposite: number): number {
    if (this.vertices >= this.vertexLimit)
      corrupt("a cluster's triangles have more vertices than it has");
    const vertex = this.vertices++;
    closes[vertex] = 0;
    predictors[3 * vertex] = a;
    predictors[3 * vertex + 1] = b;
    predictors[3 * vertex + 2] = opposite;
    return vertex;
  }

  /** Adds a vertex that the one before it predicts. */
  private addVertexAfterLast(): number {
    const before = Math.max(this.vertices, 1) - 1;
    return this.addVertex(before, before, before);
  }

  private readVertex(): number {
    return this.bits.bit() ? this.addVertexAfterLast() : this.bits.below(this.vertices);
  }

  private readApex(kind: number, edge: number): number {
    const a = edgeStart[edge];
    const b = edgeEnd[edge];
    if (kind === NEW) return this.addVertex(a, b, edgeOpposite[edge]);
    if (kind === EXPLICIT) return this.bits.below(this.vertices);
    const other = kind === END_OF_OUTGOING ? outgoing[b] : incoming[a];
    if (other === NO_EDGE) corrupt("a triangle uses an active edge that is not there");
    return kind === END_OF_OUTGOING ? edgeEnd[other] : edgeStart[other];
  }

  private unlink(edge: number): void {
    const a = edgeStart[edge];
    const b = edgeEnd[edge];
    if (outgoing[a] === edge) outgoing[a] = NO_EDGE;
    if (incoming[b] === edge) incoming[b] = NO_EDGE;
  }

  /**
   * Finishes the edge from x to y of a new triangle, opposite to w: closes the active edge that it
   * meets, or becomes an active edge (y, x), or a border edge.
   */
  private finishEdge(x: number, y: number, w: number, becomesActive: number): void {
    let edge = outgoing[x];
    if (edge === NO_EDGE || edgeEnd[edge] !== y) edge = incoming[y];
    if (edge !== NO_EDGE && edgeStart[edge] === x) {
      isActive[edge] = 0;
      this.unlink(edge);
    } else if (becomesActive) {
      const added = this.edges++;
      outgoing[y] = added;
      incoming[x] = added;
      edgeStart[added] = y;
      edgeEnd[added] = x;
      edgeOpposite[added] = w;
      isActive[added] = 1;
    } else {
      const at = 2 * this.borderEdges++;
      border[at] = x;
      border[at + 1] = y;
    }
  }
}
