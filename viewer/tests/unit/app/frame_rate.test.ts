import { describe, expect, test } from "vitest";
import { adaptedPixelError } from "../../../app/src/frame_rate.js";
import { PIXELS } from "../../../app/src/state.js";

/** The allowed error after many frames of one duration. */
function after(frames: number, pixelError: number, interval: number): number {
  let pixels = pixelError;
  for (let i = 0; i < frames; ++i) pixels = adaptedPixelError(pixels, 60, interval);
  return pixels;
}

describe("holding a frame rate", () => {
  test("raises the error while frames are slow, up to its limit", () => {
    expect(after(1, 2, 40)).toBeGreaterThan(2);
    expect(after(1000, 2, 40)).toBe(PIXELS.high);
  });

  test("lowers the error while frames are fast, down to one pixel", () => {
    expect(after(1, 2, 10)).toBeLessThan(2);
    expect(after(1000, 2, 10)).toBe(1);
  });

  test("keeps the error at the frame rate, and after pauses", () => {
    for (const interval of [18, 0, 5000]) expect(after(10, 2, interval)).toBe(2);
  });
});
