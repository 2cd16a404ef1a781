import { readFileSync } from "node:fs";
import type { Page } from "@playwright/test";
import type { GroupInfo } from "../../packages/umbel/src/decode/group.js";
import { cameraView } from "../../packages/umbel/src/select/select.js";
import { assetBytes, expectedOf, words } from "../support/assets.js";
import { loadAsset, select } from "../support/loaded_asset.js";
import {
  canvasPicture,
  dropAsset,
  expect,
  measureCanvas,
  openLink,
  type Pose,
  quiet,
  settled,
  slide,
  statistics,
  test,
} from "./page.js";

const PLANET = "/?asset=planet.umbel";
/** Few triangles, for software rendering. */
const COARSE = `${PLANET}#pixels=6`;
const ASSET = loadAsset("planet");
const LEVELS = expectedOf("planet").levels.length;
const TRIANGLES = words(expectedOf("planet").triangles);

/** Number of triangles that the library selects for a pose. */
function libraryTriangles(pose: Pose, fov: number, height: number, pixels: number): number {
  const view = cameraView(pose.position, (fov * Math.PI) / 180, height, pixels);
  return select(ASSET, view).reduce((sum, c) => sum + TRIANGLES[c], 0);
}

function cameraDistance(page: Page): Promise<number> {
  return page.evaluate(() => {
    const { position, target } = (
      globalThis.umbelViewer as NonNullable<typeof globalThis.umbelViewer>
    ).viewport.camera.pose;
    return Math.hypot(...position.map((x, i) => x - target[i]));
  });
}

test("opens, streams and shows", async ({ page, host }) => {
  const problems: string[] = [];
  page.on("pageerror", (error) => problems.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error") problems.push(message.text());
  });
  await page.goto(host.url + PLANET);
  const { triangles, fetchedBytes } = await settled(page);
  expect(triangles).toBeGreaterThan(5000);
  expect(fetchedBytes).toBeLessThan(assetBytes("planet").length / 2);
  expect(fetchedBytes).toBe(host.sent);
  expect((await measureCanvas(page)).covered).toBeGreaterThan(0.1);
  await expect(page.locator(".title h1")).toHaveText("planet.umbel");
  await expect(page.locator(".title p")).toHaveText(`327,680 triangles, ${LEVELS} levels`);
  await expect(page.locator('[data-counter="draws"] .value')).toHaveText("1");
  expect(problems).toEqual([]);
});

test("the whole asset is shown as large as it is, though coarse clusters stick out", async ({
  page,
  host,
}) => {
  await page.goto(`${host.url}/?asset=scattered.umbel`);
  await settled(page);
  const sizes = await page.evaluate(() => {
    const [mesh] = (globalThis.umbelViewer as NonNullable<typeof globalThis.umbelViewer>).viewport
      .meshes;
    return [mesh.box, mesh.shownBox()].map(({ min, max }) => min.distanceTo(max));
  });
  const [all, shown] = sizes as [number, number];
  expect(all).toBeGreaterThan(1.3 * shown);
  const distance = await cameraDistance(page);
  await page.keyboard.press("Home");
  await settled(page);
  expect(await cameraDistance(page)).toBeCloseTo(distance, 1);
  // Half the width needs more distance, and the camera is still where the whole asset is shown.
  await page.keyboard.press("c");
  await settled(page);
  expect(await cameraDistance(page)).toBeGreaterThan(1.1 * distance);
});

test("orbiting and zooming change the cut", async ({ page, host }) => {
  await page.goto(host.url + COARSE);
  const before = await settled(page);
  await page.mouse.move(210, 180);
  await page.mouse.wheel(0, -1500);
  await page.waitForFunction(
    (triangles) =>
      (globalThis.umbelViewer?.viewport.meshes[0].statistics?.triangles ?? 0) > 1.1 * triangles,
    before.triangles,
  );
  const close = await settled(page);
  await page.mouse.down();
  await page.mouse.move(330, 200, { steps: 4 });
  await page.mouse.up();
  const turned = await settled(page);
  expect(turned.triangles).not.toBe(close.triangles);
});

test("the error slider draws as many triangles as the library selects", async ({ page, host }) => {
  await page.goto(host.url + PLANET);
  await settled(page);
  const seen = [];
  for (const at of [0.1, 0.35, 0.6, 0.85]) {
    await slide(page, "#pixels", at);
    const { triangles } = await settled(page);
    const { pose, fov, height, pixels } = await page.evaluate(() => {
      const { viewport } = globalThis.umbelViewer as NonNullable<typeof globalThis.umbelViewer>;
      const fov = viewport.camera.perspective.getEffectiveFOV();
      return {
        pose: viewport.camera.pose,
        fov,
        height: viewport.height,
        pixels: viewport.meshes[0].pixelError,
      };
    });
    expect(triangles).toBe(libraryTriangles(pose, fov, height, pixels));
    seen.push(triangles);
  }
  expect(seen).toEqual([...seen].sort((a, b) => b - a));
  expect(new Set(seen).size).toBe(seen.length);
});

test("the budget is kept along a camera path", async ({ page, host }) => {
  await page.goto(`${host.url}${PLANET}#pixels=0.5&mode=shaded&budget=4`);
  await settled(page);
  const most = await page.evaluate(async () => {
    const { viewport } = globalThis.umbelViewer as NonNullable<typeof globalThis.umbelViewer>;
    let most = 0;
    for (let i = 0; i < 60; ++i) {
      const angle = i / 10;
      const distance = 1.6 + Math.sin(i / 4);
      viewport.camera.setPose({
        position: [Math.sin(angle) * distance, 0.4, Math.cos(angle) * distance],
        target: [0, 0, 0],
      });
      await new Promise((next) => requestAnimationFrame(next));
      most = Math.max(most, viewport.meshes[0].statistics?.residentBytes ?? 0);
    }
    return most;
  });
  const { budget, scale } = await settled(page);
  // The rest is for tables, and for what buffers have free.
  expect(budget).toBe((7 / 8) * (13 / 16) * 4 * 2 ** 20);
  expect(most).toBeLessThanOrEqual(budget);
  expect(most).toBeGreaterThan(budget / 2);
  expect(scale).toBeGreaterThan(1);
  await expect(page.getByText("The memory allows")).toBeVisible();
});

test("every view mode shows another picture", async ({ page, host }) => {
  await page.goto(`${host.url}${COARSE}`);
  await settled(page);
  const colors: Record<string, number> = {};
  const pictures = new Set<string>();
  for (const mode of ["shaded", "clusters", "groups", "levels", "error", "overlap", "pages"]) {
    await page.locator(`[data-mode=${mode}]`).click();
    await quiet(page);
    colors[mode] = (await measureCanvas(page)).colors;
    pictures.add((await canvasPicture(page)).toString("base64"));
  }
  await page.keyboard.press("1");
  await page.keyboard.press("w");
  await quiet(page);
  pictures.add((await canvasPicture(page)).toString("base64"));
  expect(pictures.size).toBe(8);
  expect(colors.clusters).toBeGreaterThan(3 * colors.shaded);
});

test("boxes of the overlap mode take the memory of one box", async ({ page, host }) => {
  await page.goto(`${host.url}${PLANET}#pixels=6&mode=overlap`);
  const geometries: number[] = [];
  for (const pixels of [6, 8, 12, 16]) {
    await slide(page, "#pixels", Math.log(pixels / 0.25) / Math.log(256));
    await settled(page);
    geometries.push(
      await page.evaluate(
        () => globalThis.umbelViewer?.viewport.renderer.info.memory.geometries as number,
      ),
    );
  }
  expect(new Set(geometries).size).toBe(1);
});

test("pictures equal the stored ones", async ({ page, host }) => {
  // With little error, so that the pictures do not depend on the simplification.
  await page.setViewportSize({ width: 300, height: 240 });
  for (const [name, eye] of [
    ["front", "1.9,1.5,2.7"],
    ["back", "-1.2,0.3,-2"],
  ]) {
    await page.goto("about:blank");
    await page.goto(`${host.url}${PLANET}#eye=${eye}&target=0,0,0&pixels=0.5`);
    await settled(page);
    expect(await canvasPicture(page)).toMatchSnapshot(`${name}.png`);
  }
});

test("a frozen cut stays while the camera moves", async ({ page, host }) => {
  await page.goto(host.url + COARSE);
  const before = await settled(page);
  await page.keyboard.press("f");
  await page.mouse.move(210, 180);
  await page.mouse.wheel(0, -500);
  await quiet(page);
  expect((await statistics(page)).triangles).toBe(before.triangles);
  await page.keyboard.press("f");
  expect((await settled(page)).triangles).not.toBe(before.triangles);
});

test("an asset that is opened while another is frozen is shown", async ({ page, host }) => {
  await page.goto(host.url + COARSE);
  await settled(page);
  await page.locator("#freeze").check();
  // The frozen cut stays beside another asset, which has none yet.
  await page.keyboard.press("c");
  await page.waitForFunction(
    () => (globalThis.umbelViewer?.viewport.meshes[1]?.drawn.triangles ?? 0) > 0,
  );
  await expect(page.locator("#freeze")).toBeChecked();
  await page.keyboard.press("c");
  await page.keyboard.press("c");
  await dropAsset(page, "blob_16bits_compact.umbel", "other.umbel");
  await expect(page.locator(".title h1")).toHaveText("other.umbel");
  await settled(page);
  await expect(page.locator("#freeze")).not.toBeChecked();
});

test("an asset without triangles is opened, and loads no longer", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=empty.umbel`);
  await expect(page.locator(".title p")).toHaveText("0 triangles, 0 levels");
  await expect(page.locator(".progress.done")).toBeAttached();
});

test("a click picks a cluster and shows its properties", async ({ page, host }) => {
  await page.goto(host.url + COARSE);
  await settled(page);
  await page.mouse.click(210, 180);
  const card = page.locator("#picked");
  await expect(card.locator("h2")).toHaveText(/^Cluster [\d,]+$/);
  const cluster = Number(((await card.locator("h2").textContent()) ?? "").replace(/\D/g, ""));
  await expect(card).toContainText(`Triangles${TRIANGLES[cluster]}`);
  const group = ASSET.dag.info.find(
    (info) =>
      info && info.firstCluster <= cluster && cluster - info.firstCluster < info.clusterCount,
  ) as GroupInfo;
  await expect(card).toContainText(`Group${group.group}`);
  await page.keyboard.press("Escape");
  await expect(card).toHaveCount(0);
  await page.mouse.click(20, 340);
  await expect(card).toHaveCount(0);
});

test("the canvas has the pixels of the screen, if these change as well", async ({ page, host }) => {
  await page.goto(host.url + COARSE);
  await settled(page);
  const height = () => page.evaluate(() => globalThis.umbelViewer?.viewport.height as number);
  const before = await height();
  const session = await page.context().newCDPSession(page);
  await session.send("Emulation.setDeviceMetricsOverride", {
    width: 720,
    height: 360,
    deviceScaleFactor: 2,
    mobile: false,
  });
  // Emulation does not report the change: the next frame notices it.
  await page.keyboard.press("ArrowLeft");
  await expect.poll(height).toBe(2 * before);
});

test.describe("on a very large screen", () => {
  test.use({ viewport: { width: 6000, height: 200 }, deviceScaleFactor: 2 });

  test("the canvas has no more pixels than the browser gives it", async ({ page, host }) => {
    await page.goto(`${host.url}${PLANET}#pixels=32`);
    await settled(page);
    const [asked, given] = await page.evaluate(() => {
      const { renderer } = (globalThis.umbelViewer as NonNullable<typeof globalThis.umbelViewer>)
        .viewport;
      const gl = renderer.getContext();
      const { width, height } = renderer.domElement;
      return [
        [width, height],
        [gl.drawingBufferWidth, gl.drawingBufferHeight],
      ];
    });
    expect(given[0]).toBeLessThan(2 * (6000 - 300));
    expect(asked).toEqual(given);
  });
});

test("another link in the address bar is followed", async ({ page, host }) => {
  await page.goto(`${host.url}${COARSE}`);
  await settled(page);
  await page.evaluate(() => {
    location.hash = "#eye=5,1,0&target=0,0,0&mode=levels&pixels=8&budget=64";
  });
  await expect
    .poll(() => page.evaluate(() => globalThis.umbelViewer?.state))
    .toMatchObject({ viewMode: "levels", pixelError: 8, budget: 2 ** 26 });
  const { position } = (await page.evaluate(
    () => globalThis.umbelViewer?.viewport.camera.pose,
  )) as Pose;
  expect(position[0]).toBeCloseTo(5, 6);
});

test("a link has the camera and the view mode", async ({ page, host, context }) => {
  await page.goto(host.url + COARSE);
  await settled(page);
  await page.keyboard.press("3");
  await page.mouse.move(210, 180);
  await page.mouse.wheel(0, -400);
  await settled(page);
  const pose = await page.evaluate(() => globalThis.umbelViewer?.viewport.camera.pose as Pose);
  const other = await openLink(page, context);
  const there = await other.evaluate(() => globalThis.umbelViewer?.viewport.camera.pose as Pose);
  for (let i = 0; i < 3; ++i) expect(there.position[i]).toBeCloseTo(pose.position[i], 4);
  await expect(other.locator("[data-mode=groups]")).toHaveAttribute("aria-pressed", "true");
});

test("a frame that may not copy links says so", async ({ page, host, context }) => {
  const copy = async (allow: string) => {
    const other = host.url.replace("127.0.0.1", "localhost");
    await page.goto(`${other}/index.html`);
    await page.setContent(`<iframe src="${host.url}${COARSE}" ${allow}></iframe>`);
    const frame = page.frameLocator("iframe");
    // The page of the frame is small: its settings are hidden.
    await frame.getByRole("button", { name: "Settings" }).click();
    await frame.locator("#share").click();
    return frame.locator(".notice.shown");
  };
  await expect(await copy("")).toContainText("does not let it copy links");
  await context.grantPermissions(["clipboard-write"]);
  await expect(await copy('allow="clipboard-write"')).toHaveText("Link copied.");
});

test("side by side and wipe draw the full mesh beside it", async ({ page, host }) => {
  await page.goto(`${host.url}${COARSE}`);
  const { triangles } = await settled(page);
  for (const layout of ["side", "wipe"]) {
    await page.locator(`[data-layout=${layout}]`).click();
    await page.waitForFunction(
      (few) => {
        const right = globalThis.umbelViewer?.viewport.meshes[1];
        return right?.statistics?.isSettled && right.statistics.triangles > 10 * few;
      },
      triangles,
      { timeout: 30_000 },
    );
    await quiet(page);
    await expect(page.locator(".names")).toContainText("Full mesh");
  }
  const full = await page.evaluate(
    () => globalThis.umbelViewer?.viewport.meshes[1].statistics?.triangles,
  );
  expect(full).toBe(ASSET.header.meshes[0].sourceTriangles);
  await page.locator("[data-layout=single]").click();
  await expect(page.locator(".divider")).toBeHidden();
});

test("a dropped file opens", async ({ page, host }) => {
  await page.goto(host.url);
  await expect(page.getByRole("alert")).toContainText("Drop an .umbel file here");
  await dropAsset(page, "blob_16bits_compact.umbel", "blob.umbel");
  await settled(page);
  await expect(page.locator(".title h1")).toHaveText("blob.umbel");
});

test("camera paths are recorded, saved and replayed", async ({ page, host }) => {
  await page.goto(`${host.url}${COARSE}`);
  await settled(page);
  await page.keyboard.press("r");
  await page.mouse.move(210, 180);
  await page.mouse.down();
  await page.mouse.move(300, 170, { steps: 4 });
  await page.mouse.up();
  await page.waitForTimeout(200);
  await page.keyboard.press("r");
  const waiting = page.waitForEvent("download");
  await page.getByRole("button", { name: "Save path" }).click();
  const saved = JSON.parse(readFileSync(await (await waiting).path(), "utf-8"));
  expect(saved.kind).toBe("umbel-camera-path");
  expect(saved.keys.length).toBeGreaterThan(1);
  const end: [number, number, number] = saved.keys[saved.keys.length - 1].position;
  await page.keyboard.press("Home");
  await page.locator("#replay").click();
  await page.waitForFunction(
    (wanted) =>
      globalThis.umbelViewer?.viewport.camera.pose.position.every(
        (x, i) => Math.abs(x - wanted[i]) < 1e-3,
      ),
    end,
  );
});

test("a picture is saved", async ({ page, host }) => {
  await page.goto(`${host.url}${COARSE}`);
  await settled(page);
  const waiting = page.waitForEvent("download");
  await page.keyboard.press("s");
  const download = await waiting;
  expect(download.suggestedFilename()).toBe("planet.umbel.png");
  const png = readFileSync(await download.path());
  expect(png.subarray(1, 4).toString()).toBe("PNG");
  expect(png.length).toBeGreaterThan(5000);
});

test("a small screen shows the picture, and the settings on demand", async ({ page, host }) => {
  await page.setViewportSize({ width: 390, height: 780 });
  await page.goto(`${host.url}${COARSE}`);
  await settled(page);
  await expect(page.locator("#panel")).toBeHidden();
  await page.getByRole("button", { name: "Settings" }).click();
  await expect(page.locator("#panel")).toBeVisible();
  const { width } = await page.evaluate(() => ({ width: document.documentElement.scrollWidth }));
  expect(width).toBe(390);
});

test("a hidden panel can be shown again, also where the screen was turned", async ({
  page,
  host,
}) => {
  await page.setViewportSize({ width: 390, height: 780 });
  await page.goto(`${host.url}${COARSE}`);
  await settled(page);
  await page.setViewportSize({ width: 844, height: 390 });
  await page.getByRole("button", { name: "Settings" }).click();
  await expect(page.locator("#panel")).toBeVisible();
  await expect(page.getByRole("button", { name: "Settings" })).toBeHidden();
});

test("long names do not cover each other", async ({ page, host }) => {
  const name = `${"long_name_".repeat(9)}.umbel`;
  await page.route(`**/${name}`, async (route) => {
    const answer = await route.fetch({ url: `${host.url}/planet.umbel` });
    await route.fulfill({ response: answer });
  });
  const rectangle = async (selector: string) => {
    const box = await page.locator(selector).boundingBox();
    return box as NonNullable<typeof box>;
  };
  for (const width of [390, 800]) {
    await page.goto("about:blank");
    await page.setViewportSize({ width, height: 500 });
    await page.goto(`${host.url}/?asset=${name}&compare=${name}#pixels=32`);
    await settled(page);
    const title = await rectangle(".title h1");
    const right = await rectangle(width < 700 ? ".panel-button" : "#panel");
    expect(title.x + title.width).toBeLessThanOrEqual(right.x);
    const overflow = await page
      .locator(".title h1, .names span")
      .evaluateAll((all) =>
        all.map((each) =>
          getComputedStyle(each).overflow === "hidden" ? 0 : each.scrollWidth - each.clientWidth,
        ),
      );
    expect(Math.max(...overflow)).toBe(0);
  }
});
