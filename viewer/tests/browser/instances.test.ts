import { expect, measureCanvas, type Pose, settled, slide, statistics, test } from "./page.js";

const FOREST = "/?asset=forest.umbel#pixels=4";
const NEAR: Pose = { position: [400, 12, 400], target: [460, 0, 440] };
const FAR: Pose = { position: [400, 9000, -9000], target: [400, 0, 400] };

/** Goes to a pose and waits for all that is selected there. */
async function go(page: import("@playwright/test").Page, pose: Pose) {
  await page.evaluate((to) => {
    globalThis.umbelViewer?.viewport.camera.setPose(to);
  }, pose);
  await page.waitForTimeout(300);
  return settled(page);
}

test("a forest is shown as finely as the camera needs, from near and from afar", async ({
  page,
  host,
}) => {
  const problems: string[] = [];
  page.on("pageerror", (error) => problems.push(error.message));
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type())) problems.push(message.text());
  });
  await page.goto(host.url + FOREST);
  await settled(page);
  const near = await go(page, NEAR);
  expect(near.instances).toBe(70_001);
  expect(near.shownInstances).toBeGreaterThan(1000);
  // The ground and the trees.
  expect((await measureCanvas(page)).covered).toBeGreaterThan(0.4);
  const drawn = await page.evaluate(() => ({
    ...globalThis.umbelViewer?.viewport.meshes[0].drawn,
    objects: globalThis.umbelViewer?.viewport.meshes[0].children.length,
  }));
  expect(drawn.triangles).toBeGreaterThan(0.5 * near.triangles);
  expect(drawn.calls).toBeLessThan(100);

  const far = await go(page, FAR);
  expect(far.shownInstances).toBeLessThan(near.shownInstances / 4);
  // Rows that are gone leave nothing behind.
  const objects = await page.evaluate(
    () => globalThis.umbelViewer?.viewport.meshes[0].children.length,
  );
  expect(objects).toBeLessThan(drawn.objects as number);
  expect(problems.filter((text) => !text.includes("GPU stall"))).toEqual([]);
});

test("a forest can be tinted, drawn as lines and made coarser", async ({ page, host }) => {
  await page.goto(host.url + FOREST);
  await settled(page);
  const before = await go(page, NEAR);
  const plain = await measureCanvas(page);
  await page.keyboard.press("2");
  await settled(page);
  expect((await measureCanvas(page)).colors).toBeGreaterThan(plain.colors);
  await page.keyboard.press("w");
  await settled(page);
  await slide(page, "#pixels", 16);
  await page.waitForTimeout(300);
  await settled(page);
  expect((await statistics(page)).shownInstances).toBeLessThan(before.shownInstances);
});
