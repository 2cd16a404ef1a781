// A static host for tests: the built page and the tests' assets, with the faults of hosts and
// connections.

import { createReadStream, existsSync, readFileSync, statSync } from "node:fs";
import { createServer, type IncomingMessage, type Server, type ServerResponse } from "node:http";
import type { AddressInfo } from "node:net";
import { extname, join, resolve } from "node:path";

const TYPES: Record<string, string> = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
};

export class Host {
  /** Whether HTTP ranges are supported. */
  hasRanges = true;
  /** Whether requests for assets are answered at all. */
  isDown = false;
  /** The status that requests for assets are answered with, in place of the asset. */
  status: number | undefined;
  /** The Content-Security-Policy of the page. */
  policy: string | undefined;
  /** Bytes of assets that were sent. */
  sent = 0;
  /** Damages an asset's bytes. */
  damage: ((bytes: Buffer) => void) | undefined;
  private server!: Server;

  constructor(private readonly folders: readonly string[]) {}

  async start(): Promise<void> {
    this.server = createServer((request, response) => this.answer(request, response));
    await new Promise<void>((ready) => {
      this.server.listen(0, "127.0.0.1", ready);
    });
  }

  get url(): string {
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
  }

  stop(): void {
    this.server.closeAllConnections();
    this.server.close();
  }

  private find(path: string): string | undefined {
    return this.folders
      .map((folder) => join(folder, path))
      .find(
        (file) =>
          this.folders.some((folder) => resolve(file).startsWith(resolve(folder))) &&
          existsSync(file) &&
          statSync(file).isFile(),
      );
  }

  private answer(request: IncomingMessage, response: ServerResponse): void {
    const path = decodeURIComponent(new URL(request.url ?? "/", this.url).pathname);
    const file = this.find(path === "/" ? "index.html" : path);
    if (!file) {
      response.writeHead(404).end();
      return;
    }
    const type = TYPES[extname(file)];
    if (type) {
      const policy = this.policy ? { "Content-Security-Policy": this.policy } : {};
      response.writeHead(200, { "Content-Type": type, ...policy });
      createReadStream(file).pipe(response);
      return;
    }
    if (this.isDown) {
      request.socket.destroy();
      return;
    }
    if (this.status !== undefined) {
      response.writeHead(this.status).end();
      return;
    }
    this.sendAsset(readFileSync(file), request.headers.range, response);
  }

  private sendAsset(bytes: Buffer, header: string | undefined, response: ServerResponse): void {
    this.damage?.(bytes);
    const range = /^bytes=(\d+)-(\d+)$/.exec(header ?? "");
    if (!range || !this.hasRanges) {
      this.sent += bytes.length;
      response.writeHead(200, { "Content-Length": bytes.length }).end(bytes);
      return;
    }
    const [first, last] = [Number(range[1]), Math.min(Number(range[2]), bytes.length - 1)];
    const part = bytes.subarray(first, last + 1);
    this.sent += part.length;
    response
      .writeHead(206, {
        "Content-Length": part.length,
        "Content-Range": `bytes ${first}-${last}/${bytes.length}`,
      })
      .end(part);
  }
}
