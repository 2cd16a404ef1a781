// Where the bytes of an asset come from: an address, by HTTP ranges where the server has them, or
// a local file.

import { UmbelError } from "../errors.js";

export interface ByteSource {
  /** Bytes that came over so far. */
  readonly fetched: number;
  /** Fewer bytes than asked for only where the file ends. */
  read(offset: number, length: number): Promise<Uint8Array>;
  /** Ends what is under way. */
  close(): void;
}

/** A local file, dropped or chosen, or bytes in memory. */
export class BlobSource implements ByteSource {
  fetched = 0;

  constructor(private readonly blob: Blob) {}

  async read(offset: number, length: number): Promise<Uint8Array> {
    try {
      const part = await this.blob.slice(offset, offset + length).arrayBuffer();
      this.fetched += part.byteLength;
      return new Uint8Array(part);
    } catch {
      throw new UmbelError("network", "The file can no longer be read: was it moved or changed?");
    }
  }

  close(): void {}
}

/** The whole file as it arrives, from a server that has no ranges. */
class Download {
  private bytes: Uint8Array;
  private size = 0;
  private done = false;
  private error: unknown;
  private waiting: (() => void)[] = [];

  constructor(
    response: Response,
    private readonly count: (bytes: number) => void,
  ) {
    const length = Number(response.headers.get("Content-Length") ?? 0);
    this.bytes = new Uint8Array(Math.min(Math.max(length, 1 << 16), 2 ** 31));
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
    this.done = true;
    this.wake();
  }

  private append(part: Uint8Array): void {
    if (this.size + part.length > this.bytes.length) {
      const larger = new Uint8Array(Math.max(2 * this.bytes.length, this.size + part.length));
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
    while (this.size < offset + length && !this.done)
      await new Promise<void>((wake) => {
        this.waiting.push(wake);
      });
    if (this.error !== undefined && this.size < offset + length) throw this.error;
    return this.bytes.slice(offset, Math.min(offset + length, this.size));
  }
}

export interface HttpOptions {
  /** How often a request that failed is tried again, at most. */
  retries?: number;
  /** Milliseconds before the first retry; each further one waits twice as long. */
  delay?: number;
  /** Told when a request failed and will be tried again, and when one succeeds after that. */
  onConnection?: (isLost: boolean) => void;
  fetch?: typeof fetch;
}

export class HttpSource implements ByteSource {
  fetched = 0;
  private readonly aborter = new AbortController();
  private download: Download | undefined;
  private isLost = false;

  constructor(
    readonly url: string,
    private readonly options: HttpOptions = {},
  ) {}

  close(): void {
    this.aborter.abort();
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    if (length <= 0) return new Uint8Array(0);
    const { retries = 5, delay = 400 } = this.options;
    for (let attempt = 0; ; ++attempt) {
      try {
        const bytes = await this.request(offset, length);
        this.tell(false);
        return bytes;
      } catch (error) {
        if (error instanceof UmbelError && error.kind !== "network") throw error;
        if (this.aborter.signal.aborted || attempt === retries) throw this.asError(error);
        this.download = undefined;
        this.tell(true);
        await new Promise((resolve) => setTimeout(resolve, delay * 2 ** Math.min(attempt, 5)));
      }
    }
  }

  private tell(isLost: boolean): void {
    if (isLost !== this.isLost) this.options.onConnection?.(isLost);
    this.isLost = isLost;
  }

  private asError(error: unknown): UmbelError {
    if (error instanceof UmbelError) return error;
    return new UmbelError("network", `The connection to ${this.place()} was lost.`);
  }

  private place(): string {
    try {
      return new URL(this.url).host || this.url;
    } catch {
      return this.url;
    }
  }

  private async request(offset: number, length: number): Promise<Uint8Array> {
    if (this.download) return this.download.read(offset, length);
    const get = this.options.fetch ?? fetch;
    const response = await get(this.url, {
      headers: { Range: `bytes=${offset}-${offset + length - 1}` },
      signal: this.aborter.signal,
    });
    if (response.status === 206) return this.part(response, offset, length);
    if (response.status === 200) {
      // Requests that were under way at the same time share the first download.
      if (this.download) await response.body?.cancel();
      this.download ??= new Download(response, (bytes) => {
        this.fetched += bytes;
      });
      return this.download.read(offset, length);
    }
    if (response.status === 416) return new Uint8Array(0);
    if (response.status >= 500 || response.status === 408 || response.status === 429)
      throw new UmbelError(
        "network",
        `${this.place()} answered with an error (${response.status}).`,
      );
    throw new UmbelError(
      "missing",
      response.status === 404 || response.status === 410
        ? `There is no file at ${this.url}.`
        : `${this.place()} does not give out ${this.url} (${response.status}).`,
    );
  }

  private async part(response: Response, offset: number, length: number): Promise<Uint8Array> {
    const bytes = new Uint8Array(await response.arrayBuffer());
    this.fetched += bytes.length;
    const range = /^bytes (\d+)-\d+\/(\d+|\*)$/.exec(response.headers.get("Content-Range") ?? "");
    const total = range && range[2] !== "*" ? Number(range[2]) : undefined;
    const wanted = total === undefined ? length : Math.min(length, Math.max(total - offset, 0));
    if ((range && Number(range[1]) !== offset) || bytes.length < wanted)
      throw new UmbelError("network", `${this.place()} sent less than was asked for.`);
    return bytes.subarray(0, length);
  }
}
