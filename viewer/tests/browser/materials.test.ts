import type { Page } from "@playwright/test";
import { canvasPicture, expect, quiet, settled, test } from "./page.js";

/** The row of squares of make_textured.py. */
const STEP = 1.25;
const NAMES = [
  ...["unlit", "basis", "webp", "second set", "moved", "holes", "shaded corners", "glass", "lamp"],
  "unheard of",
];
const [RED, GREEN, BLUE, WHITE] = [
  [255, 0, 0],
  [0, 255, 0],
  [0, 0, 255],
  [255, 255, 255],
];

/** Colours of a square's four quarters from the upper left, as the camera in front of it sees them. */
async function quartersOf(page: Page, name: string): Promise<number[][]> {
  const x = STEP * NAMES.indexOf(name);
  await page.evaluate((at) => {
    globalThis.umbelViewer?.viewport.camera.setPose({ position: [at, 0, 2], target: [at, 0, 0] });
  }, x);
  await quiet(page);
  const png = (await canvasPicture(page)).toString("base64");
  return page.evaluate(async (data) => {
    const answer = await fetch(`data:image/png;base64,${data}`);
    const image = await createImageBitmap(await answer.blob());
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
    context.drawImage(image, 0, 0);
    const quarter = image.height / (8 * Math.tan((40 * Math.PI) / 360) * 2);
    return [
      [-1, -1],
      [1, -1],
      [-1, 1],
      [1, 1],
    ].map(([right, down]) => {
      const [u, v] = [image.width / 2 + right * quarter, image.height / 2 + down * quarter];
      return [...context.getImageData(Math.round(u), Math.round(v), 1, 1).data].slice(0, 3);
    });
  }, png);
}

function expectColors(seen: number[][], wanted: (number[] | undefined)[], within = 14): void {
  wanted.forEach((color, i) => {
    color?.forEach((c, channel) => {
      expect(Math.abs(seen[i][channel] - c)).toBeLessThanOrEqual(within);
    });
  });
}

test("textures of every kind are shown as glTF specifies", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=materials.umbel#pixels=1`);
  await settled(page);
  const plain = [RED, GREEN, BLUE, WHITE];
  for (const name of ["unlit", "basis", "webp"]) expectColors(await quartersOf(page, name), plain);
  expectColors(await quartersOf(page, "second set"), [BLUE, WHITE, RED, GREEN]);
  expectColors(await quartersOf(page, "moved"), [GREEN, GREEN, GREEN, GREEN]);
  expectColors(await quartersOf(page, "lamp"), [RED, RED, RED, RED]);
  const background = (await quartersOf(page, "glass"))[0];
  expect(Math.min(...background)).toBeGreaterThan(200);
  const holes = await quartersOf(page, "holes");
  expectColors(holes, [RED, undefined, BLUE, undefined]);
  expect(Math.min(...holes[1], ...holes[3])).toBeGreaterThan(200);
  const [upper, , lower] = await quartersOf(page, "shaded corners");
  expect(lower[1]).toBeLessThan(upper[1] - 15);
});

test("what is not shown is listed once in the panel", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=materials.umbel#pixels=1`);
  await settled(page);
  const notes = page.locator("#panel .notes li");
  await expect(notes).toHaveText(["Materials are shown without EXT_unheard_of."]);
  await page.goto("about:blank");
  await page.goto(`${host.url}/?asset=planet.umbel#pixels=6`);
  await settled(page);
  await expect(page.getByText("Not shown")).toBeHidden();
});

test("the transcoder is asked for again until it arrives", async ({ page, host }) => {
  let failures = 3;
  await page.route(/basis_transcoder/, (route) =>
    failures-- > 0 ? route.abort() : route.continue(),
  );
  await page.goto(`${host.url}/?asset=materials.umbel#pixels=1`);
  await expect(page.locator(".notes")).toContainText("Textures are late");
  await settled(page);
  await expect(page.locator(".notes")).not.toContainText("Textures are late");
});

/** The test itself reads its pictures from data addresses. */
const POLICY = "default-src 'self'; img-src data:; connect-src 'self' data:";
for (const [what, policy, notes] of [
  ["no policy for textures", POLICY, 1],
  ["no functions from text", `${POLICY}; worker-src 'self' blob:`, 1],
  ["no workers from blobs", `${POLICY}; script-src 'self' 'unsafe-eval'; worker-src 'self'`, 1],
  ["all", `${POLICY}; script-src 'self' 'unsafe-eval'; worker-src 'self' blob:`, 0],
] as const)
  test(`KTX2 is shown where the page's policy allows it, or named: ${what}`, async ({
    page,
    host,
  }) => {
    host.policy = policy;
    await page.goto(`${host.url}/?asset=materials.umbel#pixels=1`);
    await settled(page);
    const list = page.locator("#panel .notes li");
    await expect(list.filter({ hasText: "Content-Security-Policy" })).toHaveCount(notes);
    await expect(list).toHaveCount(1 + notes);
    expectColors(await quartersOf(page, "webp"), [RED, GREEN, BLUE, WHITE]);
    if (notes === 0) expectColors(await quartersOf(page, "basis"), [RED, GREEN, BLUE, WHITE]);
  });

test("the transcoder is loaded only where an asset has KTX2", async ({ page, host }) => {
  const asked: string[] = [];
  page.on("request", (request) => asked.push(request.url()));
  await page.goto(`${host.url}/?asset=large.umbel#pixels=1`);
  await settled(page);
  expect(asked.filter((url) => /basis|KTX2/.test(url))).toEqual([]);
  await page.goto("about:blank");
  await page.goto(`${host.url}/?asset=materials.umbel#pixels=1`);
  await settled(page);
  expect(asked.some((url) => /basis_transcoder[^/]*\.wasm$/.test(url))).toBe(true);
});
