// A stream of bits, the lowest of a byte first.

import { corrupt } from "../errors.js";

/** Bytes that a reader may touch behind the last; whoever makes a reader must see that they are. */
export const BIT_PADDING = 8;

export class BitReader {
  /** In bits, from the start of the view. */
  at = 0;

  constructor(private readonly view: DataView) {}

  /** The next 25 bits or more, lowest first, without taking them. */
  peek(): number {
    return this.view.getUint32(this.at >>> 3, true) >>> (this.at & 7);
  }

  /** A number of 0 to 32 bits, unsigned. */
  take(count: number): number {
    if (count > 25) {
      const low = this.take(16);
      return (this.take(count - 16) * 0x10000 + low) >>> 0;
    }
    const value = this.peek() & ((1 << count) - 1);
    this.at += count;
    return value;
  }

  /** A number below `count`. */
  below(count: number): number {
    const value = count < 2 ? 0 : this.take(32 - Math.clz32(count - 1));
    if (value >= count) corrupt(`a number of a page is ${value}, not below ${count}`);
    return value;
  }

  rice(k: number): number {
    const word = this.peek() | 0x10000;
    const quotient = 31 - Math.clz32(word & -word);
    if (quotient === 16) {
      this.at += 16;
      return this.take(32);
    }
    this.at += quotient + 1;
    return ((quotient << k) | this.take(k)) >>> 0;
  }
}
