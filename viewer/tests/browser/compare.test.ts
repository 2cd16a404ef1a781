import { loadAsset } from "../support/loaded_asset.js";
import {
  canvasPicture,
  differentPixels,
  dropAsset,
  expect,
  measureCanvas,
  openLink,
  quiet,
  settled,
  slide,
  test,
} from "./page.js";

const OTHER = "blob_16bits_compact.umbel";
const PAIR = `/?asset=planet.umbel&compare=${OTHER}#pixels=6`;

test("a wipe shows two assets, each on its side of the line", async ({ page, host }) => {
  await page.goto(host.url + PAIR);
  await settled(page);
  await page.waitForFunction(
    () => globalThis.umbelViewer?.viewport.meshes[1]?.statistics?.isSettled,
  );
  await expect(page.locator(".names")).toContainText("planet.umbel");
  await expect(page.locator(".names")).toContainText(OTHER);
  const meshes = await page.evaluate(() =>
    globalThis.umbelViewer?.viewport.meshes.map(({ info }) => info.sourceTriangles),
  );
  const triangles = (name: string) => loadAsset(name).header.meshes[0].sourceTriangles;
  expect(meshes).toEqual([triangles("planet"), triangles(OTHER.replace(".umbel", ""))]);

  const divider = page.locator(".divider");
  const { x, y, width, height } = (await divider.boundingBox()) as {
    x: number;
    y: number;
    width: number;
    height: number;
  };
  const picture = async () => {
    await quiet(page);
    return canvasPicture(page);
  };
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  await page.mouse.move(4, y + height / 2, { steps: 3 });
  const other = await picture();
  await page.mouse.move(416, y + height / 2, { steps: 3 });
  await page.mouse.up();
  const own = await picture();
  expect(await page.evaluate(() => globalThis.umbelViewer?.state.wipe)).toBeGreaterThan(0.95);
  expect(await differentPixels(page, own, other)).toBeGreaterThan(0.03);
});

test("keys move the line that has the focus, and not the camera", async ({ page, host }) => {
  await page.goto(host.url + PAIR);
  await settled(page);
  const wipe = () => page.evaluate(() => globalThis.umbelViewer?.state.wipe);
  const eye = () => page.evaluate(() => globalThis.umbelViewer?.viewport.camera.pose.position);
  const line = page.getByRole("slider", { name: "Line between the pictures" });
  await expect(line).toHaveAttribute("aria-valuenow", "50");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Tab");
  await expect(line).toBeFocused();
  const before = await eye();
  for (const [key, at] of [
    ["ArrowLeft", 0.48],
    ["PageUp", 0.58],
    ["Home", 0.02],
    ["ArrowDown", 0.02],
    ["End", 0.98],
  ] as const) {
    await page.keyboard.press(key);
    expect(await wipe()).toBeCloseTo(at, 6);
  }
  await expect(line).toHaveAttribute("aria-valuenow", "98");
  await quiet(page);
  expect(await eye()).toEqual(before);
  // Other keys do what they do elsewhere.
  await page.keyboard.press("c");
  await page.keyboard.press("c");
  await expect(page.locator("[data-layout=side]")).toHaveAttribute("aria-pressed", "true");
  await expect(line).toHaveCount(0);
});

test("a link to one picture opens as one picture, also where another asset is named", async ({
  page,
  host,
  context,
}) => {
  await page.goto(host.url + PAIR);
  await settled(page);
  await page.locator("[data-layout=single]").click();
  const other = await openLink(page, context);
  await expect(other.locator("[data-layout=single]")).toHaveAttribute("aria-pressed", "true");
  await expect(other.locator(".divider")).toBeHidden();
  await other.locator("[data-layout=side]").click();
  await expect(other.locator(".names")).toContainText(OTHER);
});

test("addresses that name no asset are those of the page without", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=planet.umbel&compare=#pixels=6`);
  await settled(page);
  await expect(page.locator("[data-layout=single]")).toHaveAttribute("aria-pressed", "true");
  await page.locator("[data-layout=wipe]").click();
  await expect(page.locator(".names")).toContainText("Full mesh");
  await page.waitForFunction(() => globalThis.umbelViewer?.viewport.meshes[1] !== undefined);
});

test("a file dropped on the right half is the one to compare with", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=planet.umbel#pixels=6&layout=side`);
  await settled(page);
  await dropAsset(page, OTHER, "dropped.umbel", { clientX: 600, clientY: 100 });
  await expect(page.locator(".names")).toContainText("dropped.umbel");
  await expect(page.locator(".title h1")).toHaveText("planet.umbel");
});

test("a dropped file is compared where its picture is right of the line", async ({
  page,
  host,
  context,
}) => {
  await page.setViewportSize({ width: 1280, height: 360 });
  await page.goto(`${host.url}/?asset=planet.umbel#pixels=6&layout=side`);
  await settled(page);
  // Left of the middle of the page, beside which the panel is.
  await dropAsset(page, OTHER, "dropped.umbel", { clientX: 560, clientY: 100 });
  await expect(page.locator(".names span").last()).toHaveText("dropped.umbel");
  await expect(page.locator(".title h1")).toHaveText("planet.umbel");
  await context.grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.locator("#share").click();
  await expect(page.locator(".notice")).toContainText("a file of this device cannot be in it");
});

test("messages about the second asset go with it", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=planet.umbel&compare=materials.umbel#pixels=32`);
  await expect(page.locator(".notes li")).toHaveText([
    "Materials are shown without EXT_unheard_of.",
  ]);
  await page.locator("[data-layout=single]").click();
  await expect(page.locator(".notes li")).toHaveCount(0);
  await page.goto("about:blank");
  await page.goto(`${host.url}/?asset=planet.umbel&compare=paged.umbel#pixels=32`);
  await settled(page);
  await page.waitForFunction(
    () => globalThis.umbelViewer?.viewport.meshes[1]?.statistics?.isSettled,
  );
  await page.route(/paged\.umbel/, (route) => route.abort());
  await slide(page, "#pixels", 0);
  await expect(page.locator(".notice.shown")).toContainText("The connection is lost");
  await page.locator("[data-layout=single]").click();
  await expect(page.locator(".notice.shown")).toHaveCount(0);
});

test("a missing second asset leaves one picture and a notice, and the full mesh", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}/?asset=planet.umbel&compare=nothing.umbel#pixels=6`);
  await expect(page.locator(".notice")).toContainText("There is no file at");
  await settled(page);
  expect((await measureCanvas(page)).covered).toBeGreaterThan(0.05);
  await page.getByRole("button", { name: "Wipe" }).click();
  await expect(page.locator(".names")).toContainText("Full mesh");
  await page.waitForFunction(() => globalThis.umbelViewer?.viewport.meshes[1] !== undefined);
});

test("the full mesh is that of the asset that was opened last", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=planet.umbel#pixels=6&layout=wipe`);
  await settled(page);
  await dropAsset(page, OTHER, OTHER, { clientX: 10, clientY: 100 });
  const { sourceTriangles } = loadAsset(OTHER.replace(".umbel", "")).header.meshes[0];
  await page.waitForFunction((count) => {
    const meshes = globalThis.umbelViewer?.viewport.meshes;
    return meshes?.every((mesh) => mesh?.info.sourceTriangles === count);
  }, sourceTriangles);
});

test("a full mesh that arrives when it is no longer compared is dropped", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}/?asset=planet.umbel#pixels=6`);
  await settled(page);
  for (let press = 0; press < 3; ++press) await page.keyboard.press("c");
  await expect.poll(() => page.workers().length).toBe(1);
  await page.waitForTimeout(500);
  expect(await page.evaluate(() => globalThis.umbelViewer?.viewport.meshes[1])).toBeUndefined();
  expect(page.workers().length).toBe(1);
});

test("a picked cluster is one of its own asset, and its card goes with that", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}${PAIR}&layout=side`);
  await settled(page);
  await page.waitForFunction(
    () => globalThis.umbelViewer?.viewport.meshes[1]?.statistics?.isSettled,
  );
  await quiet(page);
  const left = { x: 0, y: 0, width: 200, height: 360 };
  const picture = () =>
    page.screenshot({ clip: left, style: "#picked, .notice { visibility: hidden }" });
  const before = await picture();
  await page.mouse.click(315, 180);
  await expect(page.locator("#picked")).toHaveCount(1);
  await quiet(page);
  expect(await differentPixels(page, before, await picture())).toBe(0);
  await page.locator("[data-layout=single]").click();
  await expect(page.locator("#picked")).toHaveCount(0);
});

test("the panel says where the memory does not hold the full mesh", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=paged.umbel#pixels=32&budget=12&layout=side`);
  await settled(page);
  await expect(page.locator("#panel")).toContainText("The memory does not hold the full mesh");
  await page.locator("[data-layout=single]").click();
  await expect(page.locator("#panel")).not.toContainText("The memory");
});
