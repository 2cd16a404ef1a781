// Splits the memory budget: textures take what they need up to a share, buffers of geometry the rest,
// without some for the tables of the page and its worker.

import type { AssetStream } from "../worker/asset_stream.js";
import type { Textures } from "./textures/textures.js";

/** Share of the budget that textures may take. */
const MAX_TEXTURE_SHARE = 0.5;
/** Share of the budget that geometry always has. */
const MIN_GEOMETRY_SHARE = 0.25;
/** Share of the budget for tables. */
const TABLE_SHARE = 3 / 16;
/** Share of buffers that groups fill; what lies free between them is too small for others. */
const FILL = 7 / 8;
/** Change of the edges' bytes, as a share of the buffers, that is worth another split. */
const EDGE_STEP = 1 / 64;

export class MemoryBudget {
  private textureBytes = 0;
  private edgeRatio = 0;
  /** Bytes of the buffers of geometry, without edges. */
  buffers = 0;

  constructor(
    private readonly stream: AssetStream,
    private readonly textures: Textures,
    private bytes: number,
  ) {
    this.set(bytes);
  }

  set(bytes: number): void {
    this.bytes = bytes;
    this.textures.limit = MAX_TEXTURE_SHARE * bytes;
    this.split();
  }

  /** Splits again if textures have grown or shrunk. */
  update(): void {
    if (this.textures.statistics.bytes !== this.textureBytes) this.split();
  }

  /** Sets the bytes of edges for each byte of other buffers. */
  setEdges(ratio: number): void {
    if (Math.abs(ratio - this.edgeRatio) < EDGE_STEP) return;
    this.edgeRatio = ratio;
    this.split();
  }

  private split(): void {
    this.textureBytes = this.textures.statistics.bytes;
    const rest = (1 - TABLE_SHARE) * this.bytes - this.textureBytes;
    this.buffers = Math.max(rest, MIN_GEOMETRY_SHARE * this.bytes) / (1 + this.edgeRatio);
    this.stream.setBudget(FILL * this.buffers);
  }
}
