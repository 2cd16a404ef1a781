// Splits the memory budget: textures take what they need up to a share, geometry takes the rest.

import type { AssetStream } from "../worker/asset_stream.js";
import type { Textures } from "./textures/textures.js";

/** Share of the budget that textures may take. */
const MAX_TEXTURE_SHARE = 0.5;
/** Share of the budget that geometry always has. */
const MIN_GEOMETRY_SHARE = 0.25;

export class MemoryBudget {
  private textureBytes = 0;

  constructor(
    private readonly stream: AssetStream,
    private readonly textures: Textures,
    private bytes: number,
  ) {
    this.textures.limit = MAX_TEXTURE_SHARE * bytes;
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

  private split(): void {
    this.textureBytes = this.textures.statistics.bytes;
    const rest = this.bytes - this.textureBytes;
    this.stream.setBudget(Math.max(rest, MIN_GEOMETRY_SHARE * this.bytes));
  }
}
