// Reads a stream of bits, the lowest bit of each byte first.

import { corrupt } from "../errors.js";

/** A reader may touch this many bytes after the last; the caller pads its buffer by as many. */
export const BIT_PADDING = 8;

export class BitReader {
  /** Position in bits, from the start of the view. */
  at = 0;

  constructor(private readonly view: DataView) {}

  /** The next 25 bits or more, lowest first; the position stays. */
  peek(): number {
    return this.view.getUint32(this.at >>> 3, true) >>> (this.at & 7);
  }

  /** Reads one bit. */
  bit(): number {
    const bit = (this.view.getUint8(this.at >>> 3) >>> (this.at & 7)) & 1;
    this.at += 1;
    return bit;
  }

  /** Reads an unsigned number of 0 to 32 bits. */
  take(count: number): number {
    if (count > 25) {
      const low = this.take(16);
      return (this.take(count - 16) * 0x10000 + low) >>> 0;
    }
    const value = this.peek() & ((1 << count) - 1);
    this.at += count;
    return value;
  }

  /** Reads a number below `count`, in as few bits as hold every such number. */
  below(count: number): number {
    const value = count < 2 ? 0 : this.take(32 - Math.clz32(count - 1));
    if (value >= count) corrupt(`a number of a page is ${value}, not below ${count}`);
    return value;
  }

  /**
   * Reads a number whose class comes first, in unary; 16 zeros escape to a plain number of 32 bits.
   * @param k bits of the first class
   * @param kind 0: all classes have as many, a Rice code; 1: each has one more than that before it,
   *     an exponential Golomb code; 2 and 3: the same, but 0 is a class of its own before the others
   */
  coded(k: number, kind: number): number {
    const word = this.peek();
    const ended = word | 0x10000;
    const zeros = 31 - Math.clz32(ended & -ended);
    if (zeros === 16) {
      this.at += 16;
      return this.take(32);
    }
    const apart = kind >> 1;
    const number = zeros - apart;
    if (number < 0) {
      this.at += 1;
      return 0;
    }
    const grows = (kind & 1) === 1;
    const bits = grows ? k + number : k;
    const least = apart + ((grows ? (1 << number) - 1 : number) << k);
    const used = zeros + 1;
    if (used + bits <= 25) {
      this.at += used + bits;
      return least + ((word >>> used) & ((1 << bits) - 1));
    }
    this.at += used;
    return (least + this.take(bits)) >>> 0;
  }
}
