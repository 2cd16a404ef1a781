// Bytes that requests brought along: what lay between two parts that were wanted. They are kept for a
// while, since parts near each other are often wanted soon after.

/** Bytes that are kept, at most. */
const MOST = 1 << 24;

export class SpareBytes {
  /** By offset in the file, the oldest first. */
  private readonly parts = new Map<number, Uint8Array>();
  private bytes = 0;

  /**
   * Keeps parts of what a request brought.
   * @param begin offset of `bytes` in the file
   * @param spares offset and size of each part
   */
  keep(begin: number, bytes: Uint8Array, spares: readonly (readonly [number, number])[]): void {
    for (const [offset, size] of spares) {
      this.take(offset, size);
      this.parts.set(offset, bytes.slice(offset - begin, offset - begin + size));
      this.bytes += size;
    }
    for (const [offset, { length }] of this.parts) {
      if (this.bytes <= MOST) return;
      this.parts.delete(offset);
      this.bytes -= length;
    }
  }

  has(offset: number): boolean {
    return this.parts.has(offset);
  }

  /** The bytes of a part, which are not kept any longer. */
  take(offset: number, size: number): Uint8Array | undefined {
    const part = this.parts.get(offset);
    if (!part) return undefined;
    this.parts.delete(offset);
    this.bytes -= part.length;
    return part.length === size ? part : undefined;
  }
}
