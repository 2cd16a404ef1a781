import { assetBytes } from "../support/assets.js";
import { expect, quiet, settled, test } from "./page.js";

/** Three textures of 4096 x 4096 texels, of 9 MB each. */
const LARGE = "/?asset=large.umbel#pixels=1";
const MAX_BYTES = 2e6;

test("all materials have their textures after few bytes", async ({ page, host }) => {
  expect(assetBytes("large").length).toBeGreaterThan(2e7);
  await page.goto(host.url + LARGE);
  await page.waitForFunction(() => performance.getEntriesByName("umbel-first-textures").length > 0);
  const { bytes, textures } = await page.evaluate(() => {
    const [mark] = performance.getEntriesByName("umbel-first-textures") as PerformanceMark[];
    const loaded = [
      ...performance.getEntriesByType("navigation"),
      ...performance.getEntriesByType("resource"),
    ] as PerformanceResourceTiming[];
    const page = loaded.reduce((sum, { transferSize }) => sum + transferSize, 0);
    return { bytes: page + mark.detail.fetchedBytes, textures: mark.detail.textures };
  });
  expect(textures.resident).toBe(3);
  // Of page and asset together, none of it compressed.
  expect(bytes).toBeLessThan(MAX_BYTES);
});

test("textures grow when the camera comes closer, within the budget", async ({ page, host }) => {
  await page.goto(`${host.url}${LARGE}&budget=64`);
  await settled(page);
  const at = (distance: number) =>
    page.evaluate(async (z) => {
      globalThis.umbelViewer?.viewport.camera.setPose({ position: [0, 0, z], target: [0, 0, 0] });
    }, distance);
  const textures = () =>
    page.evaluate(() => globalThis.umbelViewer?.viewport.meshes[0].textures as { bytes: number });
  const far = await textures();
  await at(0.4);
  await settled(page);
  const near = await textures();
  expect(near.bytes).toBeGreaterThan(4 * far.bytes);
  // Half of the memory at most; a texture of 4096 x 4096 texels would take 89 MB.
  expect(near.bytes).toBeLessThanOrEqual(32 * 2 ** 20);
  const { budget } = await settled(page);
  // The rest is for geometry, an eighth free between it, and three sixteenths of the memory for tables.
  expect(budget).toBe((7 / 8) * ((13 / 16) * 64 * 2 ** 20 - near.bytes));
  await quiet(page);
  const shown = await page.locator('[data-counter="textures"] .value').getAttribute("data-value");
  expect(Number(shown)).toBe(near.bytes);
});

test("an unreadable texture is reported, and the rest is shown", async ({ page, host }) => {
  host.damage = (bytes) => {
    // The first bytes of a JPEG, wherever one begins.
    for (
      let at = bytes.indexOf("ffd8ff", 0, "hex");
      at >= 0;
      at = bytes.indexOf("ffd8ff", at, "hex")
    )
      bytes.fill(0, at, at + 64);
  };
  await page.goto(host.url + LARGE);
  await expect(page.locator("#panel .notes li").first()).toContainText("could not be read", {
    timeout: 30_000,
  });
  await settled(page);
});
