// What browser tests share: a host, and functions that control and read the page.

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { type BrowserContext, test as base, expect, type Page } from "@playwright/test";
import type { Box3, WebGLRenderer } from "three";
import type { AssetInfo } from "../../packages/umbel/src/stream/asset_info.js";
import type { StreamStatistics } from "../../packages/umbel/src/stream/stream_update.js";
import { ASSETS, ROOT } from "../support/assets.js";
import { Host } from "./host.js";

export { expect };

/** The part of the viewer that tests use. */
interface PageViewer {
  open(asset: string): Promise<void>;
  state: { pixelError: number; viewMode: string; wipe: number };
  viewport: {
    meshes: {
      statistics?: StreamStatistics;
      drawn: { triangles: number; clusters: number; calls: number };
      pixelError: number;
      isSettled: boolean;
      position: { toArray(): number[] };
      scale: { toArray(): number[] };
      textures: { bytes: number; missing: number; resident: number };
      pages: ReadonlyMap<number, number>;
      children: unknown[];
      info: AssetInfo;
      box: Box3;
      shownBox(): Box3;
    }[];
    height: number;
    renderer: WebGLRenderer;
    camera: {
      pose: Pose;
      perspective: { getEffectiveFOV(): number };
      setPose(pose: Pose): void;
      fly(right: number, up: number, forward: number): void;
    };
    onFrame: ((counts: unknown) => void) | undefined;
  };
}

export interface Pose {
  position: [number, number, number];
  target: [number, number, number];
}

declare global {
  var umbelViewer: PageViewer | undefined;
}

export const test = base.extend<{ host: Host }>({
  // biome-ignore lint/correctness/noEmptyPattern: Playwright reads the names from the pattern
  host: async ({}, use) => {
    const host = new Host([join(ROOT, "viewer/dist"), ASSETS]);
    await host.start();
    await use(host);
    host.stop();
  },
});

/** Waits until the selected cut is drawn and on the screen. */
export async function settled(page: Page): Promise<StreamStatistics> {
  await page.waitForFunction(() => {
    const mesh = globalThis.umbelViewer?.viewport.meshes[0];
    const statistics = mesh?.statistics;
    return mesh?.isSettled && statistics && statistics.triangles > 0 && mesh.drawn.triangles > 0;
  });
  await quiet(page);
  return statistics(page);
}

/** Waits until statistics and camera do not change for some frames. */
export async function quiet(page: Page): Promise<void> {
  await page.evaluate(async () => {
    const frame = () => new Promise((next) => requestAnimationFrame(next));
    for (let same = 0, last = ""; same < 6; ) {
      await frame();
      await new Promise((next) => setTimeout(next, 30));
      const mesh = globalThis.umbelViewer?.viewport.meshes[0];
      const now = JSON.stringify([
        mesh?.statistics,
        mesh?.textures,
        mesh?.drawn,
        globalThis.umbelViewer?.viewport.camera.pose,
      ]);
      same = now === last ? same + 1 : 0;
      last = now;
    }
  });
}

export function statistics(page: Page): Promise<StreamStatistics> {
  return page.evaluate(
    () => globalThis.umbelViewer?.viewport.meshes[0].statistics as StreamStatistics,
  );
}

/** Sets a range input, as a user would. */
export async function slide(page: Page, selector: string, value: number): Promise<void> {
  await page.locator(selector).evaluate((input: HTMLInputElement, to) => {
    input.value = String(to);
    input.dispatchEvent(new Event("input", { bubbles: true }));
  }, value);
}

/** A picture of the canvas, without what floats over it. */
export function canvasPicture(page: Page): Promise<Buffer> {
  return page.locator(".viewport canvas").screenshot({
    style: ".title, .names, .divider, .progress, .notice, .panel-button { visibility: hidden }",
  });
}

export interface CanvasContent {
  /** Share of the picture's pixels that are not background. */
  covered: number;
  colors: number;
}

/** Measures how much of the canvas is covered, and by how many colours. */
export async function measureCanvas(page: Page): Promise<CanvasContent> {
  const png = (await canvasPicture(page)).toString("base64");
  return page.evaluate(async (data) => {
    const image = await createImageBitmap(
      await (await fetch(`data:image/png;base64,${data}`)).blob(),
    );
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
    context.drawImage(image, 0, 0);
    const { data: pixels } = context.getImageData(0, 0, image.width, image.height);
    const hues = new Set<number>();
    let covered = 0;
    for (let i = 0; i < pixels.length; i += 4) {
      const [r, g, b] = [pixels[i], pixels[i + 1], pixels[i + 2]];
      // The background is a light grey without a hue, brighter than anything on it.
      if (Math.min(r, g, b) > 212) continue;
      ++covered;
      hues.add(((r >> 5) << 6) | ((g >> 5) << 3) | (b >> 5));
    }
    return { covered: (4 * covered) / pixels.length, colors: hues.size };
  }, png);
}

/** The share of pixels that differ between two pictures by more than a shade. */
export function differentPixels(page: Page, a: Buffer, b: Buffer): Promise<number> {
  return page.evaluate(
    async (pictures) => {
      const [first, second] = await Promise.all(
        pictures.map(async (data) => {
          const answer = await fetch(`data:image/png;base64,${data}`);
          const image = await createImageBitmap(await answer.blob());
          const canvas = new OffscreenCanvas(image.width, image.height);
          const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
          context.drawImage(image, 0, 0);
          return context.getImageData(0, 0, image.width, image.height).data;
        }),
      );
      let different = 0;
      for (let i = 0; i < first.length; i += 4)
        if (Math.abs(first[i + 1] - second[i + 1]) > 24) ++different;
      return (4 * different) / first.length;
    },
    [a.toString("base64"), b.toString("base64")],
  );
}

/** Drops an asset of the tests on the page, as a file. */
export async function dropAsset(
  page: Page,
  asset: string,
  name: string,
  at: { clientX?: number; clientY?: number } = {},
): Promise<void> {
  const bytes = readFileSync(join(ASSETS, asset)).toString("base64");
  const dataTransfer = await page.evaluateHandle(
    async ([data, fileName]) => {
      const answer = await fetch(`data:application/octet-stream;base64,${data}`);
      const transfer = new DataTransfer();
      transfer.items.add(new File([await answer.blob()], fileName as string));
      return transfer;
    },
    [bytes, name],
  );
  await page.dispatchEvent("body", "drop", { dataTransfer, ...at });
}

/** Copies the link to the current view, and opens it in another page. */
export async function openLink(page: Page, context: BrowserContext): Promise<Page> {
  await context.grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.locator("#share").click();
  await expect(page.locator(".notice")).toHaveText("Link copied.");
  const link = await page.evaluate(() => navigator.clipboard.readText());
  const other = await context.newPage();
  await other.goto(link);
  await settled(other);
  return other;
}
