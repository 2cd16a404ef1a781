// Exported tiles as 3d-tiles-renderer shows them.
import { join } from "node:path";
import { expect, test } from "@playwright/test";
import { build } from "vite";
import { ASSETS, ROOT } from "../support/assets.js";
import { Host } from "./host.js";

const PAGE = join(ROOT, "build/viewer/tiles_page");

let host: Host;

test.beforeAll(async () => {
  await build({
    root: join(ROOT, "viewer/tests/browser/tiles_page"),
    configFile: false,
    logLevel: "error",
    build: { outDir: PAGE, emptyOutDir: true, chunkSizeWarningLimit: 4000 },
  });
  host = new Host([PAGE, ASSETS]);
  await host.start();
});

test.afterAll(() => host.stop());

/** What is shown, and how much of the picture is background. */
async function picture(page: import("@playwright/test").Page, pixels: number) {
  await page.goto(`${host.url}/?tileset=planet_tiles/tileset.json&pixels=${pixels}`);
  await page.waitForFunction(() => globalThis.shown);
  return await page.evaluate(() => {
    const canvas = document.querySelector("canvas") as HTMLCanvasElement;
    const gl = canvas.getContext("webgl2") as WebGL2RenderingContext;
    const { width, height } = canvas;
    const bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    const isRed = (x: number, y: number) => {
      const at = 4 * (y * width + x);
      return bytes[at] === 255 && bytes[at + 1] === 0 && bytes[at + 2] === 0;
    };
    let outside = 0;
    let inside = 0;
    for (let y = 0; y < height; ++y)
      for (let x = 0; x < width; ++x) {
        if (!isRed(x, y)) continue;
        ++outside;
        // Within the body there is no background.
        inside += Number(Math.hypot(x - width / 2, y - height / 2) < 0.18 * height);
      }
    return { ...globalThis.shown, outside, inside };
  });
}

test("tiles load, refine and cover the body without holes", async ({ page }, info) => {
  const coarse = await picture(page, 500);
  const fine = await picture(page, 1);
  await page.screenshot({ path: info.outputPath("tiles.png") });
  for (const shown of [coarse, fine]) {
    expect(shown.failed).toBe(0);
    expect(shown.inside).toBe(0);
    expect(shown.outside).toBeGreaterThan(1000);
  }
  expect(coarse.tiles).toBe(1);
  expect(fine.tiles).toBeGreaterThan(8);
  expect(fine.triangles ?? 0).toBeGreaterThan(4 * (coarse.triangles ?? 0));
});
