// Splits the memory budget: textures take what they need up to a share, geometry takes the rest. It
// includes what buffers have free, and some for the tables of the page and its worker.

import type { AssetStream } from "../worker/asset_stream.js";
import type { Textures } from "./textures/textures.js";

/** Share of the budget that textures may take. */
const MAX_TEXTURE_SHARE = 0.5;
/** Share of the budget that geometry always has. */
const MIN_GEOMETRY_SHARE = 0.25;
/** Share of the budget for tables. */
const TABLE_SHARE = 3 / 16;
/** Change of what buffers have free, as a share of the budget, that is worth another split. */
const SLACK_STEP = 1 / 64;

export class MemoryBudget {
  private textureBytes = 0;
  private slack = 0;
  /** What geometry may take, in bytes. */
  geometry = 0;

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

  /** Sets the bytes that buffers have free. */
  setSlack(bytes: number): void {
    if (Math.abs(bytes - this.slack) < SLACK_STEP * this.bytes) return;
    this.slack = bytes;
    this.split();
  }

  private split(): void {
    this.textureBytes = this.textures.statistics.bytes;
    const rest = (1 - TABLE_SHARE) * this.bytes - this.textureBytes - this.slack;
    this.geometry = Math.max(rest, MIN_GEOMETRY_SHARE * this.bytes);
    this.stream.setBudget(this.geometry);
  }
}
