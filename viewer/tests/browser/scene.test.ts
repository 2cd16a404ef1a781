import type { JSHandle, Page } from "@playwright/test";
import type { Box3, Mesh } from "three";
import type { UmbelMesh } from "../../packages/umbel/src/three/umbel_mesh.js";
import { expect, measureCanvas, quiet, settled, test } from "./page.js";

test.beforeEach(async ({ page, host }) => {
  await page.goto(`${host.url}/?asset=planet.umbel#pixels=64`);
  await settled(page);
});

function meshOf(page: Page): Promise<JSHandle<UmbelMesh>> {
  return page.evaluateHandle(
    () => globalThis.umbelViewer?.viewport.meshes[0] as unknown as UmbelMesh,
  );
}

/** The share of the canvas that a new frame covers. */
async function covered(page: Page, mesh: JSHandle<UmbelMesh>): Promise<number> {
  await mesh.evaluate((object) => object.onChange?.());
  await quiet(page);
  return (await measureCanvas(page)).covered;
}

test("layers of the object are those of all that it draws", async ({ page }) => {
  const mesh = await meshOf(page);
  await mesh.evaluate((object) => object.layers.set(1));
  expect(await covered(page, mesh)).toBeLessThan(0.01);
  await mesh.evaluate((object) => object.layers.enable(0));
  expect(await covered(page, mesh)).toBeGreaterThan(0.1);
});

test("materials may be drawn as wireframes", async ({ page }) => {
  const mesh = await meshOf(page);
  const setWireframe = (isWireframe: boolean) =>
    mesh.evaluate((object, wireframe) => {
      for (const material of object.materials.all) Object.assign(material, { wireframe });
    }, isWireframe);
  const whole = await covered(page, mesh);
  await setWireframe(true);
  const lines = await covered(page, mesh);
  expect(lines).toBeGreaterThan(0.2 * whole);
  expect(lines).toBeLessThan(0.8 * whole);
  await setWireframe(false);
  expect(await covered(page, mesh)).toBe(whole);
});

test("shadows and the order of drawing are the object's", async ({ page }) => {
  const mesh = await meshOf(page);
  const wanted = { castShadow: true, receiveShadow: true, renderOrder: 3 };
  await mesh.evaluate((object, properties) => void Object.assign(object, properties), wanted);
  await covered(page, mesh);
  const drawn = await mesh.evaluate(({ children }) =>
    children.map(({ castShadow, receiveShadow, renderOrder }) => {
      return { castShadow, receiveShadow, renderOrder };
    }),
  );
  expect(drawn.length).toBeGreaterThan(0);
  for (const each of drawn) expect(each).toEqual(wanted);
});

test("what is outside of the picture is drawn for other cameras and for shadows", async ({
  page,
}) => {
  const mesh = await meshOf(page);
  await page.evaluate(() => {
    globalThis.umbelViewer?.viewport.camera.setPose({ position: [0.3, 0, 1.2], target: [0, 0, 0] });
  });
  await settled(page);
  const triangles = async (properties: { frustumCulled: boolean; castShadow: boolean }) => {
    await mesh.evaluate((object, set) => void Object.assign(object, set), properties);
    await covered(page, mesh);
    return mesh.evaluate(({ drawn }) => drawn.triangles);
  };
  const culled = await triangles({ frustumCulled: true, castShadow: false });
  for (const frustumCulled of [false, true])
    expect(await triangles({ frustumCulled, castShadow: frustumCulled })).toBeGreaterThan(culled);
});

test("boxes of what is drawn are the mesh's, and it cannot be cloned", async ({ page }) => {
  const mesh = await meshOf(page);
  const { boxes, low } = await mesh.evaluate(({ children, box }) => ({
    boxes: (children as (Mesh & { boundingBox: Box3 })[]).map(({ boundingBox }) =>
      boundingBox.min.toArray(),
    ),
    low: box.min.toArray(),
  }));
  expect(boxes.length).toBeGreaterThan(0);
  for (const lowest of boxes) expect(lowest).toEqual(low);
  await expect(mesh.evaluate((object) => void object.clone())).rejects.toThrow("cannot be cloned");
});
