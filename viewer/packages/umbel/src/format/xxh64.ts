// XXH64 with seed 0, on pairs of 32-bit halves: BigInt would be ten times slower.
//
// Written from its public specification: Yann Collet, "xxHash fast digest algorithm", version
// 0.1.1 (2018).

const P1H = 0x9e3779b1;
const P1L = 0x85ebca87;
const P2H = 0xc2b2ae3d;
const P2L = 0x27d4eb4f;
const P3H = 0x165667b1;
const P3L = 0x9e3779f9;
const P4H = 0x85ebca77;
const P4L = 0xc2b2ae63;
const P5H = 0x27d4eb2f;
const P5L = 0x165667c5;

/** The high half of the product of two unsigned 32-bit numbers. */
function high(a: number, b: number): number {
  const a0 = a & 0xffff;
  const a1 = a >>> 16;
  const b0 = b & 0xffff;
  const b1 = b >>> 16;
  const low = Math.imul(a0, b0);
  const left = Math.imul(a1, b0);
  const right = Math.imul(a0, b1);
  const middle = (low >>> 16) + (left & 0xffff) + (right & 0xffff);
  return (Math.imul(a1, b1) + (left >>> 16) + (right >>> 16) + (middle >>> 16)) | 0;
}

/** A 64-bit number that operations change in place. */
class Word {
  constructor(
    public h: number,
    public l: number,
  ) {}

  copy(from: Word): this {
    this.h = from.h;
    this.l = from.l;
    return this;
  }

  add(h: number, l: number): this {
    const sum = (this.l >>> 0) + (l >>> 0);
    this.l = sum | 0;
    this.h = (this.h + h + (sum > 0xffffffff ? 1 : 0)) | 0;
    return this;
  }

  multiply(h: number, l: number): this {
    const top = high(this.l, l) + Math.imul(this.h, l) + Math.imul(this.l, h);
    this.l = Math.imul(this.l, l);
    this.h = top | 0;
    return this;
  }

  rotate(by: number): this {
    const { h, l } = this;
    if (by < 32) {
      this.h = (h << by) | (l >>> (32 - by));
      this.l = (l << by) | (h >>> (32 - by));
    } else {
      this.h = (l << (by - 32)) | (h >>> (64 - by));
      this.l = (h << (by - 32)) | (l >>> (64 - by));
    }
    return this;
  }

  xor(h: number, l: number): this {
    this.h ^= h;
    this.l ^= l;
    return this;
  }

  /** this ^= this >>> by */
  fold(by: number): this {
    const { h, l } = this;
    if (by < 32) return this.xor(h >>> by, (l >>> by) | (h << (32 - by)));
    return this.xor(0, h >>> (by - 32));
  }

  round(h: number, l: number): this {
    lane.h = h;
    lane.l = l;
    lane.multiply(P2H, P2L);
    return this.add(lane.h, lane.l).rotate(31).multiply(P1H, P1L);
  }

  merge(from: Word): this {
    merged.h = 0;
    merged.l = 0;
    merged.round(from.h, from.l);
    return this.xor(merged.h, merged.l).multiply(P1H, P1L).add(P4H, P4L);
  }
}

const lane = new Word(0, 0);
const merged = new Word(0, 0);

function rotatedSum(of: Word[]): Word {
  const by = [1, 7, 12, 18];
  const sum = new Word(0, 0);
  const part = new Word(0, 0);
  of.forEach((word, i) => {
    part.copy(word).rotate(by[i] as number);
    sum.add(part.h, part.l);
  });
  return sum;
}

/** The checksum of some bytes: its high and its low half, unsigned. */
export function xxh64(bytes: Uint8Array): [number, number] {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const size = bytes.length;
  let at = 0;
  let hash = new Word(P5H, P5L);
  if (size >= 32) {
    const a = new Word(P1H, P1L).add(P2H, P2L);
    const b = new Word(P2H, P2L);
    const c = new Word(0, 0);
    const d = new Word(~P1H, ~P1L).add(0, 1);
    for (; at + 32 <= size; at += 32) {
      a.round(view.getInt32(at + 4, true), view.getInt32(at, true));
      b.round(view.getInt32(at + 12, true), view.getInt32(at + 8, true));
      c.round(view.getInt32(at + 20, true), view.getInt32(at + 16, true));
      d.round(view.getInt32(at + 28, true), view.getInt32(at + 24, true));
    }
    hash = rotatedSum([a, b, c, d]).merge(a).merge(b).merge(c).merge(d);
  }
  hash.add(Math.floor(size / 0x100000000), size | 0);
  for (; at + 8 <= size; at += 8) {
    merged.h = 0;
    merged.l = 0;
    merged.round(view.getInt32(at + 4, true), view.getInt32(at, true));
    hash.xor(merged.h, merged.l).rotate(27).multiply(P1H, P1L).add(P4H, P4L);
  }
  if (at + 4 <= size) {
    lane.h = 0;
    lane.l = view.getInt32(at, true);
    lane.multiply(P1H, P1L);
    hash.xor(lane.h, lane.l).rotate(23).multiply(P2H, P2L).add(P3H, P3L);
    at += 4;
  }
  for (; at < size; ++at) {
    lane.h = 0;
    lane.l = bytes[at];
    lane.multiply(P5H, P5L);
    hash.xor(lane.h, lane.l).rotate(11).multiply(P1H, P1L);
  }
  hash.fold(33).multiply(P2H, P2L).fold(29).multiply(P3H, P3L).fold(32);
  return [hash.h >>> 0, hash.l >>> 0];
}

/** Whether bytes have the checksum that is stored (little-endian) at an offset of a view. */
export function hasChecksum(bytes: Uint8Array, stored: DataView, offset: number): boolean {
  const [h, l] = xxh64(bytes);
  return h === stored.getUint32(offset + 4, true) && l === stored.getUint32(offset, true);
}
