// What leaves the page as a file, and what comes in.

import { h } from "./ui/dom";

export function save(blob: Blob, name: string): void {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** The JSON in a file; undefined if there is none in it. */
export async function readJson(file: Blob): Promise<unknown> {
  try {
    return JSON.parse(await file.text());
  } catch {
    return undefined;
  }
}

/**
 * Paints the page's own background, which a canvas does not have in it: as if the page was of a
 * size, with the canvas in its corner.
 */
export function paintBackground(
  context: CanvasRenderingContext2D,
  { width, height }: { width: number; height: number } = context.canvas,
): void {
  const style = getComputedStyle(document.documentElement);
  const [x, y] = [width / 2, 0.38 * height];
  const glow = context.createRadialGradient(x, y, 0, x, y, 0.75 * Math.max(width, height));
  glow.addColorStop(0, style.getPropertyValue("--glow"));
  glow.addColorStop(1, style.getPropertyValue("--ground"));
  context.fillStyle = glow;
  context.fillRect(0, 0, context.canvas.width, context.canvas.height);
}
