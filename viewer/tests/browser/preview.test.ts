import { canvasPicture, differentPixels, expect, measureCanvas, settled, test } from "./page.js";

const PLANET = "/?asset=planet.umbel";
/** Of page and asset together, uncompressed. */
const MAX_BYTES = 210_000;

test("the preview needs few bytes, and looks like the viewer's picture", async ({ page, host }) => {
  let release = () => {};
  const held = new Promise<void>((resolve) => {
    release = resolve;
  });
  await page.route(/\/viewer-[^/]*\.js$/, async (route) => {
    await held;
    await route.continue();
  });
  await page.goto(`${host.url}${PLANET}#pixels=6`);
  await page.waitForFunction(() => performance.getEntriesByName("umbel-first-picture").length > 0);
  const { pageBytes, assetBytes } = await page.evaluate(() => {
    const mark = performance.getEntriesByName("umbel-first-picture")[0] as PerformanceMark;
    return {
      pageBytes: [
        ...performance.getEntriesByType("navigation"),
        ...performance.getEntriesByType("resource"),
      ]
        .map((entry) => entry as PerformanceResourceTiming)
        .filter((entry) => entry.responseStart < mark.startTime)
        .reduce((sum, entry) => sum + entry.transferSize, 0),
      assetBytes: mark.detail.fetchedBytes as number,
    };
  });
  expect(pageBytes).toBeGreaterThan(10_000);
  expect(assetBytes).toBeGreaterThan(10_000);
  expect(pageBytes + assetBytes).toBeLessThan(MAX_BYTES);
  const first = await measureCanvas(page);
  expect(first.covered).toBeGreaterThan(0.1);
  const preview = await canvasPicture(page);
  release();
  await settled(page);
  await expect(page.locator(".viewport canvas")).toHaveCount(1);
  const then = await measureCanvas(page);
  expect(Math.abs(then.covered - first.covered)).toBeLessThan(0.01);
  expect(await differentPixels(page, preview, await canvasPicture(page))).toBeLessThan(0.05);
});

test("the preview has the camera of the link", async ({ page, host }) => {
  await page.route(/\/viewer-[^/]*\.js$/, () => {});
  const seen = [];
  for (const eye of ["0,0,6", "0,0,3"]) {
    await page.goto("about:blank");
    await page.goto(`${host.url}${PLANET}#eye=${eye}&target=0,0,0&pixels=6`);
    await page.waitForFunction(
      () => performance.getEntriesByName("umbel-first-picture").length > 0,
    );
    seen.push((await measureCanvas(page)).covered);
  }
  expect(seen[1]).toBeGreaterThan(2 * seen[0]);
});
