import { assetBytes } from "../support/assets.js";
import { loadAsset } from "../support/loaded_asset.js";
import { expect, measureCanvas, settled, statistics, test } from "./page.js";

const PLANET = "/?asset=planet.umbel";

test("a host without HTTP ranges works too", async ({ page, host }) => {
  host.hasRanges = false;
  await page.goto(host.url + PLANET);
  await settled(page);
  expect((await measureCanvas(page)).covered).toBeGreaterThan(0.1);
  expect(host.sent).toBeLessThanOrEqual(2 * assetBytes("planet").length);
});

test("a damaged page stays coarse and is reported", async ({ page, host }) => {
  const { header } = loadAsset("planet");
  // A coarse page, which every view needs.
  const damaged = 2;
  host.damage = (bytes) => {
    bytes[header.pages.offset[damaged] + 48] ^= 1;
  };
  await page.goto(`${host.url}${PLANET}#pixels=0.5`);
  await expect(page.locator(".notice")).toContainText("it stays coarse there");
  const { damagedPages, triangles } = await statistics(page);
  expect(damagedPages).toBe(1);
  expect(triangles).toBeGreaterThan(500);
  expect((await measureCanvas(page)).covered).toBeGreaterThan(0.1);
});

test("a missing file is reported", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=nothing.umbel`);
  await expect(page.getByRole("alert")).toContainText("Not found");
  await expect(page.getByRole("alert")).toContainText("There is no file at");
});

test("another kind of file is reported as such", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=index.html`);
  await expect(page.getByRole("alert")).toContainText("This is not an .umbel file.");
});

test("damaged tables are reported", async ({ page, host }) => {
  host.damage = (bytes) => {
    bytes[700] ^= 1;
  };
  await page.goto(host.url + PLANET);
  await expect(page.getByRole("alert")).toContainText("The file is damaged");
});

test("a lost connection is reported, and loading goes on once it is back", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}${PLANET}#pixels=32`);
  const before = await settled(page);
  host.isDown = true;
  await page.locator("#pixels").evaluate((input: HTMLInputElement) => {
    input.value = "0.2";
    input.dispatchEvent(new Event("input"));
  });
  await expect(page.locator(".notice")).toContainText("The connection is lost");
  expect((await measureCanvas(page)).covered).toBeGreaterThan(0.1);
  host.isDown = false;
  await page.waitForFunction(
    (few) =>
      globalThis.umbelViewer?.viewport.meshes[0].statistics?.isSettled &&
      globalThis.umbelViewer.viewport.meshes[0].statistics.triangles > 2 * few,
    before.triangles,
  );
  await expect(page.locator(".notice")).toContainText("The connection is back");
});

test("a browser without WebGL 2 gets a message", async ({ page, host }) => {
  await page.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = () => null;
  });
  await page.goto(host.url + PLANET);
  await expect(page.getByRole("alert")).toContainText("It needs WebGL 2");
});
