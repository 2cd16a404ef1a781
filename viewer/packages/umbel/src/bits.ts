// A stream of bits, the lowest of a byte first.

/** Bytes that a reader may touch behind the last; whoever makes a reader must see that they are. */
export const BIT_PADDING = 8;

export class BitReader {
  /** In bits, from the start of the view. */
  at = 0;

  constructor(private readonly view: DataView) {}

  /** The next 25 bits or more, lowest first, without taking them. */
  private peek(): number {
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

  /** How many zeros come before the next one, which is taken too; after `most` (<= 16) zeros, that. */
  zeros(most: number): number {
    const word = this.peek() | (1 << most);
    const count = 31 - Math.clz32(word & -word);
    this.at += count < most ? count + 1 : most;
    return count;
  }

  rice(k: number): number {
    const quotient = this.zeros(16);
    if (quotient === 16) return this.take(32);
    return ((quotient << k) | this.take(k)) >>> 0;
  }
}
