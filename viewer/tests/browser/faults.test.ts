import { writeFileSync } from "node:fs";
import type { Page } from "@playwright/test";
import { assetBytes } from "../support/assets.js";
import { loadAsset } from "../support/loaded_asset.js";
import {
  canvasPicture,
  differentPixels,
  dropAsset,
  expect,
  measureCanvas,
  settled,
  slide,
  statistics,
  test,
} from "./page.js";

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
  // The message is not about the next asset.
  await dropAsset(page, "blob_16bits_compact.umbel", "other.umbel");
  await expect(page.locator(".title h1")).toHaveText("other.umbel");
  await settled(page);
  await expect(page.locator(".notice.shown")).toHaveCount(0);
});

test("a missing file is reported", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=nothing.umbel`);
  await expect(page.getByRole("alert")).toContainText("Not found");
  await expect(page.getByRole("alert")).toContainText("There is no file at");
});

test("a server that refuses the file is reported as such", async ({ page, host }) => {
  for (const [status, words] of [
    [401, "(401): it asks for a login."],
    [403, "(403)."],
  ] as const) {
    host.status = status;
    await page.goto(host.url + PLANET);
    await expect(page.getByRole("alert")).toContainText("No access");
    await expect(page.getByRole("alert")).toContainText(`planet.umbel ${words}`);
  }
});

test("another kind of file is reported as such", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=index.html`);
  await expect(page.getByRole("alert")).toContainText("This is not an .umbel file.");
});

test("an invalid address is reported", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=http://[bad`);
  await expect(page.getByRole("alert")).toContainText("http://[bad is not an address.");
});

test("an asset that cannot be opened leaves the one before", async ({ page, host }) => {
  await page.goto(`${host.url}${PLANET}#pixels=32`);
  await settled(page);
  for (const close of [
    () => page.keyboard.press("Escape"),
    () => page.getByRole("alert").getByText("Close").click(),
  ]) {
    await dropAsset(page, "planet.json", "wrong.umbel");
    await expect(page.getByRole("alert")).toContainText("This is not an .umbel file.");
    await close();
    await expect(page.getByRole("alert")).toBeHidden();
    await expect(page.locator(".title h1")).toHaveText("planet.umbel");
  }
});

test("an asset that cannot be opened leaves the notes of the one before", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}/?asset=materials.umbel#pixels=32`);
  await expect(page.locator(".notes li")).toHaveCount(1);
  await dropAsset(page, "planet.json", "wrong.umbel");
  await expect(page.getByRole("alert")).toContainText("This is not an .umbel file.");
  await expect(page.locator(".notes li")).toHaveCount(1);
});

test("a file that has changed on the disk is named as such", async ({ page, host }, info) => {
  const path = info.outputPath("local.umbel");
  writeFileSync(path, assetBytes("paged"));
  await page.goto(`${host.url}/#pixels=32`);
  await page.locator("input[type=file]").setInputFiles(path);
  await settled(page);
  writeFileSync(path, assetBytes("planet"));
  await slide(page, "#pixels", 0.2);
  await expect(page.locator(".notice.shown")).toContainText("The file can no longer be read");
  await page.locator("input[type=file]").dispatchEvent("change");
  await expect(page.getByRole("alert")).toContainText("Not readable");
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

test("a connection that is lost before an asset is open is reported", async ({ page, host }) => {
  host.isDown = true;
  await page.goto(`${host.url}${PLANET}#pixels=32`);
  await expect(page.locator(".title p")).toHaveText("The connection is lost. Trying again …");
  host.isDown = false;
  await settled(page);
  await expect(page.locator(".title p")).toContainText("triangles");
  host.isDown = true;
  await page.evaluate(() => void globalThis.umbelViewer?.open("paged.umbel"));
  await expect(page.locator(".notice.shown")).toContainText("The connection is lost");
  host.isDown = false;
  await expect(page.locator(".title h1")).toHaveText("paged.umbel");
  await settled(page);
  await expect(page.locator(".notice.shown")).toHaveCount(0);
});

test("a file that is gone for a while is asked for again", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=paged.umbel#pixels=32`);
  const before = await settled(page);
  host.status = 404;
  await slide(page, "#pixels", 0.2);
  await expect(page.locator(".notice")).toContainText("The connection is lost");
  host.status = undefined;
  await expect(page.locator(".notice")).toContainText("The connection is back");
  const { triangles, damagedPages } = await settled(page);
  expect(triangles).toBeGreaterThan(2 * before.triangles);
  expect(damagedPages).toBe(0);
});

test("textures of a file that is gone for a while arrive once it is back", async ({
  page,
  host,
}) => {
  let isGone = true;
  await page.route(/materials\.umbel$/, async (route) => {
    const begin = Number(/bytes=(\d+)/.exec(route.request().headers().range ?? "")?.[1]);
    if (isGone && begin > 0) await route.fulfill({ status: 403 });
    else await route.continue();
  });
  await page.goto(`${host.url}/?asset=materials.umbel#pixels=32`);
  await expect(page.locator(".notes")).toContainText("Textures are late");
  isGone = false;
  await expect(page.locator(".notes")).not.toContainText("Textures are late", { timeout: 30_000 });
  await settled(page);
  await expect(page.locator(".notes")).not.toContainText("could not be read");
});

test("a lost GPU is reported, and the picture comes back with it", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=large.umbel#pixels=2&wireframe=1`);
  await settled(page);
  const before = await canvasPicture(page);
  const extension = await page.evaluateHandle(() =>
    globalThis.umbelViewer?.viewport.renderer.getContext().getExtension("WEBGL_lose_context"),
  );
  await extension.evaluate((context) => context?.loseContext());
  await expect(page.locator(".notice.shown")).toContainText("took the GPU away");
  await page.setViewportSize({ width: 700, height: 340 });
  await page.setViewportSize({ width: 720, height: 360 });
  await extension.evaluate((context) => context?.restoreContext());
  await expect(page.locator(".notice.shown")).toHaveCount(0);
  await settled(page);
  expect(await differentPixels(page, before, await canvasPicture(page))).toBeLessThan(0.002);
});

test("a lost connection stays reported after a lost GPU and short notices", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}${PLANET}#pixels=32`);
  await settled(page);
  host.status = 403;
  await slide(page, "#pixels", 0.2);
  const notice = page.locator(".notice.shown");
  await expect(notice).toContainText("The connection is lost");
  const extension = await page.evaluateHandle(() =>
    globalThis.umbelViewer?.viewport.renderer.getContext().getExtension("WEBGL_lose_context"),
  );
  await extension.evaluate((context) => context?.loseContext());
  await expect(notice).toContainText("took the GPU away");
  await extension.evaluate((context) => context?.restoreContext());
  await expect(notice).toContainText("The connection is lost");
  await page.locator("#share").click();
  await expect(notice).toContainText("ink");
  await expect(notice).toContainText("The connection is lost");
  host.status = undefined;
  await expect(notice).toContainText("The connection is back");
  await expect(notice).toHaveCount(0);
});

test("a page that did not load whole can be loaded again", async ({ page, host }) => {
  await page.route(/\/viewer-[^/]*\.js$/, (route) => route.abort(), { times: 1 });
  await page.goto(`${host.url}${PLANET}#pixels=32`);
  await expect(page.getByRole("alert")).toContainText("The viewer did not start");
  await page.getByRole("button", { name: "Try again" }).click();
  await settled(page);
});

/** Puts code before the worker's. */
async function runInWorker(page: Page, code: string): Promise<void> {
  await page.route(/\/stream_worker-[^/]*\.js$/, async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, body: `${code}\n${await response.text()}` });
  });
}

test("a worker without memory is reported, and goes on once there is some", async ({
  page,
  host,
}) => {
  await runInWorker(
    page,
    `const end = performance.now() + 6000;
    globalThis.Int32Array = new Proxy(Int32Array, {
      construct(type, args) {
        if (performance.now() < end && args[0] > 5000)
          throw new RangeError("Array buffer allocation failed");
        return Reflect.construct(type, args);
      },
    });`,
  );
  await page.goto(`${host.url}${PLANET}#pixels=1`);
  await expect(page.locator(".notice.shown")).toContainText("The browser has no memory left");
  await settled(page);
  expect((await statistics(page)).damagedPages).toBe(0);
  await expect(page.locator(".notice.shown")).toHaveCount(0);
});

test("a page without memory is reported, and goes on once there is some", async ({
  page,
  host,
}) => {
  await page.addInitScript(() => {
    const end = performance.now() + 6000;
    globalThis.Uint32Array = new Proxy(Uint32Array, {
      construct(type, args) {
        if (performance.now() < end && args[0] > 10_000)
          throw new RangeError("Array buffer allocation failed");
        return Reflect.construct(type, args);
      },
    });
  });
  await page.goto(`${host.url}${PLANET}#pixels=1`);
  await expect(page.locator(".notice.shown")).toContainText("The browser has no memory left");
  await settled(page);
  expect((await measureCanvas(page)).covered).toBeGreaterThan(0.1);
});

test("errors of the worker that nothing expects are reported", async ({ page, host }) => {
  for (const failure of ["throw", "void Promise.reject"]) {
    await page.unrouteAll();
    await runInWorker(page, `setTimeout(() => { ${failure}(new Error("a defect")); }, 3000);`);
    await page.goto("about:blank");
    await page.goto(`${host.url}${PLANET}#pixels=32`);
    await expect(page.locator(".notice")).toContainText("a defect");
  }
});

test("a browser without WebGL 2 gets a message", async ({ page, host }) => {
  await page.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = () => null;
  });
  await page.goto(host.url + PLANET);
  await expect(page.getByRole("alert")).toContainText("It needs WebGL 2");
});
