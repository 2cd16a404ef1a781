// Reads an asset at an address, by HTTP ranges where the server has them.

import { checkNumber, UmbelError } from "../errors.js";
import { Download } from "./download.js";
import {
  asUmbelError,
  type FetchOptions,
  hostOf,
  patientFetch,
  statusError,
} from "./patient_fetch.js";
import type { ByteSource } from "./source.js";

export interface HttpOptions extends FetchOptions {
  /** Number of times that a failed request is tried again. */
  retries?: number;
  /** Milliseconds before the first retry; each further delay is twice as long. */
  delay?: number;
  /** Called when a request fails and will be tried again, and when one succeeds after that. */
  onConnection?: (isLost: boolean) => void;
}

export class HttpSource implements ByteSource {
  fetched = 0;
  private readonly aborter = new AbortController();
  private download: Download | undefined;
  private isLost = false;
  /** Whether the host compresses the file whatever is asked for; undefined until that is known. */
  private isCompressed: boolean | undefined;
  /** Bytes of the file, once an answer has told. */
  private total: number | undefined;

  constructor(
    readonly url: string,
    private readonly options: HttpOptions = {},
  ) {
    const { retries, delay, patience } = options;
    if (retries !== undefined) checkNumber("retries", retries, false);
    if (delay !== undefined) checkNumber("delay", delay, false);
    if (patience !== undefined) checkNumber("patience", patience, true);
  }

  close(): void {
    this.aborter.abort();
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    if (length <= 0) return new Uint8Array(0);
    const { retries = 5, delay = 400 } = this.options;
    for (let attempt = 0; ; ++attempt) {
      try {
        const bytes = await this.request(offset, length);
        this.report(false);
        return bytes;
      } catch (error) {
        const known = asUmbelError(error, this.url);
        if (this.aborter.signal.aborted || known.kind === "memory") throw known;
        this.report(true);
        if (known.kind !== "network" || attempt >= retries) throw known;
        this.download = undefined;
        await new Promise((resolve) => setTimeout(resolve, delay * 2 ** Math.min(attempt, 5)));
      }
    }
  }

  private report(isLost: boolean): void {
    if (isLost !== this.isLost) this.options.onConnection?.(isLost);
    this.isLost = isLost;
  }

  private async request(offset: number, length: number): Promise<Uint8Array> {
    if (this.download) return this.downloaded(this.download, offset, length);
    const range = `bytes=${offset}-${offset + length - 1}`;
    const headers: Record<string, string> = this.isCompressed ? {} : { Range: range };
    const { signal } = this.aborter;
    const response = await patientFetch(this.url, { headers, signal }, this.options).catch(
      (error: unknown) => this.compressed(error),
    );
    if (response.status === 206) {
      this.isCompressed = false;
      return this.part(response, offset, length);
    }
    if (response.status === 200) {
      // Simultaneous requests share the first download.
      if (this.download) await response.body?.cancel();
      this.download ??= new Download(response, (bytes) => {
        this.fetched += bytes;
      });
      return this.downloaded(this.download, offset, length);
    }
    if (response.status === 416) return this.checked(new Uint8Array(0), offset, length);
    throw statusError(response.status, this.url);
  }

  /**
   * The whole file, from a host that compresses it whatever is asked for: browsers refuse compressed
   * answers to requests for ranges. Throws `error` if the host does not compress.
   */
  private async compressed(error: unknown): Promise<Response> {
    const { signal } = this.aborter;
    if (!(error instanceof TypeError) || this.isCompressed !== undefined) throw error;
    const response = await patientFetch(this.url, { signal }, this.options);
    this.isCompressed = response.status === 200 && response.headers.has("Content-Encoding");
    if (this.isCompressed) return response;
    await response.body?.cancel();
    throw error;
  }

  private async part(response: Response, offset: number, length: number): Promise<Uint8Array> {
    const bytes = new Uint8Array(await response.arrayBuffer());
    this.fetched += bytes.length;
    const range = /^bytes (\d+)-\d+\/(\d+|\*)$/.exec(response.headers.get("Content-Range") ?? "");
    const total = range && range[2] !== "*" ? Number(range[2]) : undefined;
    // Browsers hide the range of other hosts' answers, if these do not expose it. Only the first bytes
    // of a file are read without knowing its length.
    const most = offset === 0 && bytes.length > 0 ? bytes.length : Infinity;
    if (range && Number(range[1]) !== offset) this.tooShort();
    this.total = total ?? this.total;
    return this.checked(bytes.subarray(0, length), offset, length, most);
  }

  /** From an answer that may be another file's, as that of a page to log in. */
  private async downloaded(from: Download, offset: number, length: number): Promise<Uint8Array> {
    return this.checked(await from.read(offset, length), offset, length);
  }

  /** @param most bytes of the file, where that is not known */
  private checked(bytes: Uint8Array, offset: number, length: number, most = 0): Uint8Array {
    const end = Math.min(offset + length, this.total ?? most);
    if (bytes.length < end - offset) this.tooShort();
    return bytes;
  }

  private tooShort(): never {
    throw new UmbelError("network", `${hostOf(this.url)} sent less than was asked for.`);
  }
}
