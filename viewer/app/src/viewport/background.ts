// The page's background as a texture of the scene, because transmissive materials show only what is
// in the scene.

import { CanvasTexture, LinearFilter, type Material, type Scene, SRGBColorSpace } from "three";
import { paintBackground } from "../files";
import { h } from "../ui/dom";

export class Background {
  private isNeeded = false;

  constructor(private readonly scene: Scene) {}

  /** Adds the background if a material is transmissive. */
  prepare(material: Material, width: number, height: number): void {
    if (this.isNeeded || !((material as { transmission?: number }).transmission ?? 0)) return;
    this.isNeeded = true;
    this.paint(width, height);
  }

  /** Paints again; to be called when the page's size or colours have changed. */
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

  /** Removes the background until another transmissive material comes. */
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
