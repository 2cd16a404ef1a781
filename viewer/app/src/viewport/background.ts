// The page's background as a picture in the scene: what glass lets through must be drawn there.

import { CanvasTexture, LinearFilter, type Material, type Scene, SRGBColorSpace } from "three";
import { paintBackground } from "../files";
import { h } from "../ui/dom";

export class Backdrop {
  private isNeeded = false;

  constructor(private readonly scene: Scene) {}

  /** Sees whether a material lets the background through. */
  prepare(material: Material, width: number, height: number): void {
    if (this.isNeeded || !((material as { transmission?: number }).transmission ?? 0)) return;
    this.isNeeded = true;
    this.paint(width, height);
  }

  /** To be called when the page's size or colours have changed. */
  paint(width: number, height: number): void {
    if (!this.isNeeded) return;
    this.clear();
    const canvas = h("canvas", { width: Math.max(width, 1), height: Math.max(height, 1) });
    const page = { width: innerWidth, height: innerHeight };
    paintBackground(canvas.getContext("2d") as CanvasRenderingContext2D, page);
    const texture = new CanvasTexture(canvas);
    texture.colorSpace = SRGBColorSpace;
    texture.minFilter = LinearFilter;
    texture.generateMipmaps = false;
    this.scene.background = texture;
  }

  /** For another asset, which may have no glass. */
  reset(): void {
    this.isNeeded = false;
    this.clear();
  }

  private clear(): void {
    if (this.scene.background && "dispose" in this.scene.background)
      this.scene.background.dispose();
    this.scene.background = null;
  }
}
