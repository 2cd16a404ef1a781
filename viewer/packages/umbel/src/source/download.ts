// A download of a whole file, from a server without HTTP ranges.

import { UmbelError } from "../errors.js";

/** Reads wait until their bytes have arrived. */
export class Download {
  private bytes: Uint8Array;
  private size = 0;
  private isDone = false;
  private error: unknown;
  private waiting: (() => void)[] = [];

  constructor(
    response: Response,
    private readonly count: (bytes: number) => void,
  ) {
    const length = Number(response.headers.get("Content-Length") ?? 0);
    this.bytes = allocated(Math.min(Math.max(length, 1 << 16), 2 ** 31));
    this.run(response);
  }

  private async run(response: Response): Promise<void> {
    try {
      const reader = (response.body as ReadableStream<Uint8Array>).getReader();
      for (let part = await reader.read(); !part.done; part = await reader.read())
        this.append(part.value);
    } catch (error) {
      this.error = error;
    }
    this.isDone = true;
    this.wake();
  }

  private append(part: Uint8Array): void {
    if (this.size + part.length > this.bytes.length) {
      const larger = allocated(Math.max(2 * this.bytes.length, this.size + part.length));
      larger.set(this.bytes.subarray(0, this.size));
      this.bytes = larger;
    }
    this.bytes.set(part, this.size);
    this.size += part.length;
    this.count(part.length);
    this.wake();
  }

  private wake(): void {
    const waiting = this.waiting;
    this.waiting = [];
    for (const wake of waiting) wake();
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    while (this.size < offset + length && !this.isDone)
      await new Promise<void>((wake) => {
        this.waiting.push(wake);
      });
    if (this.error !== undefined && this.size < offset + length) throw this.error;
    return this.bytes.slice(offset, Math.min(offset + length, this.size));
  }
}

function allocated(bytes: number): Uint8Array<ArrayBuffer> {
  try {
    return new Uint8Array(bytes);
  } catch {
    throw new UmbelError(
      "memory",
      "The server has no HTTP ranges, and the browser has no memory for the whole file.",
    );
  }
}
