// Compares the asset with its full mesh, or with another asset: side by side, or by a wipe.

import type { AssetLoader } from "./asset_loader";
import { type Layout, nameOf, type Source, type State } from "./state";
import { Divider } from "./ui/divider";
import type { Notice } from "./ui/messages";
import type { Viewport } from "./viewport/viewport";

export class Comparison {
  /** The asset to compare with; undefined for the full mesh. */
  other: Source | undefined;
  private source: Source | undefined;
  /** Number of loads so far: one that is no longer wanted is dropped when it arrives. */
  private loads = 0;
  private isLoading = false;
  private readonly divider: Divider;

  constructor(
    host: HTMLElement,
    private readonly state: State,
    private readonly viewport: Viewport,
    private readonly loader: AssetLoader,
    private readonly notice: Notice,
  ) {
    this.divider = new Divider(host, (at) => {
      this.state.wipe = at;
      this.updateDivider();
    });
  }

  /** Sets the asset that is compared, which is shown already. */
  setSource(source: Source): void {
    this.source = source;
    // The full mesh is that of the asset before.
    if (!this.other) this.clearRight();
  }

  /** Compares with another asset, in the current layout or by a wipe. */
  async setOther(other: Source): Promise<void> {
    this.other = other;
    this.clearRight();
    await this.setLayout(this.state.layout === "single" ? "wipe" : this.state.layout);
  }

  async setLayout(layout: Layout): Promise<void> {
    const { viewport } = this;
    const wasHome = viewport.camera.isHome;
    this.state.layout = layout;
    if (wasHome) viewport.frameAll();
    if (layout === "single") this.clearRight();
    else if (!viewport.meshes[1] && !this.isLoading && this.source)
      await this.loadRight(this.source);
    this.updateDivider();
  }

  private clearRight(): void {
    ++this.loads;
    this.isLoading = false;
    this.viewport.setMesh(1, undefined);
  }

  private async loadRight(source: Source): Promise<void> {
    const load = ++this.loads;
    this.isLoading = true;
    try {
      // The full mesh has no error; another asset has the same error as the first.
      const pixelError = this.other ? this.state.pixelError : 0;
      const mesh = await this.loader.load(this.other ?? source, pixelError);
      if (load !== this.loads) return mesh.dispose();
      this.isLoading = false;
      this.viewport.rightFollows = this.other !== undefined;
      this.viewport.setMesh(1, mesh);
    } catch (error) {
      if (load !== this.loads) return;
      this.isLoading = false;
      this.state.layout = "single";
      // The full mesh can still be compared with.
      this.other = undefined;
      this.notice.show(error instanceof Error ? error.message : String(error));
    }
  }

  private updateDivider(): void {
    const right = this.other ? nameOf(this.other) : "Full mesh";
    const left = this.source ? nameOf(this.source) : "";
    this.divider.update(this.state.layout, this.state.wipe, [left, right]);
    this.viewport.requestFrame();
  }
}
