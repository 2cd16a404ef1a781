import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { ASSETS, assetBytes } from "../support/assets.js";
import { jsonSection, originSection, withSections } from "../support/rewrite.js";
import {
  canvasPicture,
  differentPixels,
  expect,
  openLink,
  type Pose,
  settled,
  test,
} from "./page.js";

const UTM = [448_250, 5_411_900, 312] as const;
const NAME = "planet";

/** The same mesh with another origin. */
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

test("an asset far from zero looks like one at zero, and its points are in the world", async ({
  page,
  host,
  context,
}) => {
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
  const point = /Point(-?[\d.]+), (-?[\d.]+), (-?[\d.]+) metre/.exec(text);
  expect(point).not.toBeNull();
  const offset = UTM.map((x, i) => Number(point?.[i + 1]) - x);
  expect(Math.hypot(...offset)).toBeGreaterThan(0.5);
  expect(Math.hypot(...offset)).toBeLessThan(1.5);

  await page.keyboard.press("Escape");
  const other = await openLink(page, context);
  expect(await differentPixels(other, here, await canvasPicture(other))).toBeLessThan(0.001);
});

test("two assets with different origins have the right relative position", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}/?asset=moved_a.umbel&compare=moved_b.umbel#pixels=6`);
  await settled(page);
  await page.waitForFunction(
    () => globalThis.umbelViewer?.viewport.meshes[1]?.statistics?.isSettled,
  );
  const positions = await page.evaluate(() =>
    globalThis.umbelViewer?.viewport.meshes.map(({ position }) => position.toArray()),
  );
  expect(positions).toEqual([
    [0, 0, 0],
    [0.5, 0, -0.25],
  ]);
});
