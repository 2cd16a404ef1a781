import {
  canvasPicture,
  differentPixels,
  expect,
  openLink,
  type Pose,
  quiet,
  settled,
  test,
} from "./page.js";

const EXPONENTS = [-30, -21, 15];

for (const kind of ["flat", "smooth"])
  test(`${kind} assets of any size look the same, and so do their previews`, async ({
    page,
    host,
  }) => {
    let release: (() => void) | undefined;
    await page.route(/\/viewer-[^/]*\.js$/, async (route) => {
      await new Promise<void>((resolve) => {
        release = resolve;
      });
      await route.continue();
    });
    const pictures = async (exponent: number) => {
      await page.goto("about:blank");
      await page.goto(`${host.url}/?asset=${kind}_1e${exponent}.umbel`);
      await page.waitForFunction(
        () => performance.getEntriesByName("umbel-first-picture").length > 0,
      );
      const preview = await canvasPicture(page);
      // The viewer is asked for after the preview's picture.
      await expect.poll(() => release).toBeDefined();
      release?.();
      release = undefined;
      await settled(page);
      return [preview, await canvasPicture(page)];
    };
    const wanted = await pictures(0);
    for (const exponent of EXPONENTS)
      for (const [i, picture] of (await pictures(exponent)).entries())
        expect(await differentPixels(page, picture, wanted[i])).toBeLessThan(0.005);
  });

test("a small asset follows the wheel and the mouse", async ({ page, host, context }) => {
  await page.goto(`${host.url}/?asset=flat_1e-3.umbel`);
  await settled(page);
  const distance = (on = page) =>
    on.evaluate(() => {
      const { pose } = (globalThis.umbelViewer as NonNullable<typeof globalThis.umbelViewer>)
        .viewport.camera;
      return Math.hypot(...pose.position.map((x, i) => x - pose.target[i]));
    });
  await page.mouse.move(210, 180);
  for (let step = 0; step < 3; ++step) {
    const [before, far] = [await canvasPicture(page), await distance()];
    await page.mouse.wheel(0, -100);
    await quiet(page);
    expect(await distance()).toBeLessThan(0.98 * far);
    expect(await differentPixels(page, before, await canvasPicture(page))).toBeGreaterThan(0.005);
  }
  for (let step = 0; step < 2; ++step) {
    const before = await canvasPicture(page);
    await page.mouse.down({ button: "right" });
    await page.mouse.move(210, 188 - 8 * step);
    await page.mouse.up({ button: "right" });
    await quiet(page);
    expect(await differentPixels(page, before, await canvasPicture(page))).toBeGreaterThan(0.01);
  }
  // Points, links and lengths are those of the world.
  await page.mouse.click(210, 180);
  const text = (await page.locator("#picked").textContent()) ?? "";
  const point = /Point(-?[\d.]+), (-?[\d.]+), (-?[\d.]+)/.exec(text)?.slice(1).map(Number);
  expect(Math.hypot(...(point as number[]))).toBeLessThan(1.5e-3);
  expect(Math.hypot(...(point as number[]))).toBeGreaterThan(0.5e-3);
  await page.keyboard.press("Escape");
  const other = await openLink(page, context);
  expect(await distance(other)).toBeCloseTo(await distance(), 8);
  expect(
    await differentPixels(other, await canvasPicture(page), await canvasPicture(other)),
  ).toBeLessThan(0.001);
});

test("assets that are compared have one unit", async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=flat_1e-3.umbel&compare=smooth_1e-3.umbel#layout=side`);
  await settled(page);
  await page.waitForFunction(
    () => globalThis.umbelViewer?.viewport.meshes[1]?.statistics?.isSettled,
  );
  const both = await page.evaluate(() => {
    const { viewport } = globalThis.umbelViewer as NonNullable<typeof globalThis.umbelViewer>;
    const { position } = viewport.camera.pose as Pose;
    return { units: viewport.meshes.map(({ scale }) => scale.toArray()), position };
  });
  expect(both.units[0]).toEqual(both.units[1]);
  expect(Math.hypot(...both.position)).toBeLessThan(0.02);
});
