// Holds a frame rate: adapts the allowed error to the time that frames take.

import { PIXELS } from "./state";

/** Longer frames are pauses, which are ignored. */
const MAX_INTERVAL = 1000;

/** The allowed error, in pixels, after a frame that took `interval` milliseconds. */
export function adaptedPixelError(pixelError: number, frameRate: number, interval: number): number {
  if (interval <= 0 || interval > MAX_INTERVAL) return pixelError;
  const wanted = 1000 / frameRate;
  const factor = interval > 1.25 * wanted ? 1.04 : interval < 1.05 * wanted ? 0.99 : 1;
  return Math.min(Math.max(pixelError * factor, 1), PIXELS.high);
}
