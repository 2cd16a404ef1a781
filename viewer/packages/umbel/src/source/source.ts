// Where the bytes of an asset come from; see also http_source.ts.

import { UmbelError } from "../errors.js";

export interface ByteSource {
  /** Bytes received so far. */
  readonly fetched: number;
  /** Reads `length` bytes; fewer only at the end of the file. */
  read(offset: number, length: number): Promise<Uint8Array>;
  /** Aborts requests. */
  close(): void;
}

/** A local file, or bytes in memory. */
export class BlobSource implements ByteSource {
  fetched = 0;

  constructor(private readonly blob: Blob) {}

  async read(offset: number, length: number): Promise<Uint8Array> {
    try {
      const part = await this.blob.slice(offset, offset + length).arrayBuffer();
      this.fetched += part.byteLength;
      return new Uint8Array(part);
    } catch {
      throw new UmbelError(
        "network",
        "The file cannot be read: is it a folder, or was it moved or changed?",
      );
    }
  }

  close(): void {}
}
