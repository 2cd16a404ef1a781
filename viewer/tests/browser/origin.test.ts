import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { ASSETS, assetBytes } from "../support/assets.js";
import { jsonSection, originSection, withSections } from "../support/rewrite.js";
import { canvasPicture, differentPixels, expect, type Pose, settled, test } from "./page.js";

const UTM = [448_250, 5_411_900, 312] as const;
const NAME = "planet";

/** The same mesh with its zero at a place in the world. */
function makeMoved(name: string, origin: readonly number[]): void {
  const file = withSections(assetBytes(NAME), [
    originSection(...origin),
    jsonSection("META", { coordinates: { unit: "metre", crs: "EPSG:32632" } }),
    jsonSection("SCEN", { asset: { copyright: "2026 Someone" } }),
  ]);
  writeFileSync(join(ASSETS, `${name}.umbel`), file);
}

test.beforeAll(() => {
  makeMoved("moved_a", UTM);
  makeMoved("moved_b", [UTM[0] + 0.5, UTM[1], UTM[2] - 0.25]);
});

test("an asset far out looks as one at zero, and its places are in the world", async ({
  page,
  host,
  context,
}) => {
  await context.grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.goto(`${host.url}/?asset=${NAME}.umbel#pixels=6`);
  await settled(page);
  const here = await canvasPicture(page);
  const pose = await page.evaluate(() => globalThis.umbelViewer?.viewport.camera.pose as Pose);
  await page.goto("about:blank");
  await page.goto(`${host.url}/?asset=moved_a.umbel#pixels=6`);
  await settled(page);
  expect(await differentPixels(page, here, await canvasPicture(page))).toBe(0);
  await expect(page.locator(".title")).toContainText("2026 Someone");
  const there = await page.evaluate(() => globalThis.umbelViewer?.viewport.camera.pose as Pose);
  for (let i = 0; i < 3; ++i) expect(there.position[i] - UTM[i]).toBeCloseTo(pose.position[i], 8);

  await page.mouse.click(210, 180);
  const text = (await page.locator("#picked").textContent()) ?? "";
  const place = /Point(-?[\d.]+), (-?[\d.]+), (-?[\d.]+) metre/.exec(text);
  expect(place).not.toBeNull();
  const away = UTM.map((x, i) => Number(place?.[i + 1]) - x);
  expect(Math.hypot(...away)).toBeGreaterThan(0.5);
  expect(Math.hypot(...away)).toBeLessThan(1.5);

  await page.keyboard.press("Escape");
  await page.locator("#share").click();
  await expect(page.locator(".notice")).toHaveText("Link copied.");
  const link = await page.evaluate(() => navigator.clipboard.readText());
  const other = await context.newPage();
  await other.goto(link);
  await settled(other);
  expect(await differentPixels(other, here, await canvasPicture(other))).toBeLessThan(0.001);
});

test("two assets with different origins stand where they belong", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=moved_a.umbel&compare=moved_b.umbel#pixels=6`);
  await settled(page);
  await page.waitForFunction(
    () => globalThis.umbelViewer?.viewport.meshes[1]?.statistics?.isSettled,
  );
  const places = await page.evaluate(() =>
    globalThis.umbelViewer?.viewport.meshes.map(({ position }) => position.toArray()),
  );
  expect(places).toEqual([
    [0, 0, 0],
    [0.5, 0, -0.25],
  ]);
});
