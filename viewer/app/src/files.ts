// Reads and writes files, and paints the page's background into pictures.

import { h } from "./ui/dom";

export function save(blob: Blob, name: string): void {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** The JSON of a file; undefined if the file is not JSON. */
export async function readJson(file: Blob): Promise<unknown> {
  try {
    return JSON.parse(await file.text());
  } catch {
    return undefined;
  }
}

/** Paints the background of a page of some size onto a canvas in the page's corner. */
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
