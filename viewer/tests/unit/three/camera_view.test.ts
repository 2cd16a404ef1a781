import { Camera, Matrix4, OrthographicCamera, PerspectiveCamera, Vector3 } from "three";
import { describe, expect, test } from "vitest";
import {
  isSphereOutside,
  mustRefine,
  timesTooLarge,
} from "../../../packages/umbel/src/select/select.js";
import {
  isSamePose,
  pixelsPerUnit,
  poseOf,
  sceneViewOf,
  viewOf,
} from "../../../packages/umbel/src/three/camera_view.js";
import { Random } from "../../support/random.js";

describe("a pose", () => {
  const poses = (x: number, turn: number) => {
    const camera = new PerspectiveCamera(40, 1.5, 0.1, 10);
    camera.position.set(x, 0, 3e-6);
    camera.rotation.y = turn;
    camera.updateMatrixWorld();
    return poseOf(camera, new Matrix4());
  };

  test("is equal at rest, and differs after a small move at any scale", () => {
    const before = poses(1e-6, 0.3);
    expect(isSamePose(poses(1e-6 * (1 + 1e-15), 0.3 + 1e-16), before)).toBe(true);
    expect(isSamePose(poses(1.000001e-6, 0.3), before)).toBe(false);
    expect(isSamePose(poses(1e-6, 0.300001), before)).toBe(false);
    expect(isSamePose(before, [])).toBe(false);
  });
});

test("a part of a picture is as fine as the whole", () => {
  const settings = { pixelError: 1, offscreen: 4 };
  const world = new Matrix4();
  for (const camera of [
    new PerspectiveCamera(40, 1.5, 0.1, 10),
    new OrthographicCamera(-3, 3, 2, -2, 0.1, 10),
  ]) {
    camera.position.z = 5;
    camera.zoom = 1.5;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    const sizes = (view: object) =>
      Object.values(view).filter((value) => typeof value === "number") as number[];
    const whole = sizes(viewOf({ ...settings, camera, height: 1200 }, world));
    const pixels = pixelsPerUnit(camera, world, 1200)(2);
    camera.setViewOffset(1800, 1200, 450, 300, 450, 300);
    camera.updateProjectionMatrix();
    const part = sizes(viewOf({ ...settings, camera, height: 300 }, world));
    expect(whole.length).toBeGreaterThan(0);
    whole.forEach((value, i) => {
      expect(part[i] / value).toBeCloseTo(1, 6);
    });
    expect(pixelsPerUnit(camera, world, 300)(2) / pixels).toBeCloseTo(1, 6);
  }
});

test.each([
  ["perspective", new PerspectiveCamera(60, 1, 0.1, 10)],
  ["orthographic", new OrthographicCamera(-1, 1, 1, -1, 0.1, 10)],
])("outside of the picture of a %s camera more error is allowed", (_, camera) => {
  camera.position.z = 2;
  camera.updateMatrixWorld();
  const view = viewOf({ camera, height: 100, pixelError: 1, offscreen: 4 }, new Matrix4());
  if (view.kind === "level") throw new Error("a camera selects no level");
  // At the centre of the picture, and as far away to its right.
  const side = Math.sqrt(12);
  const spheres = Float32Array.of(0, 0, -2, 0.1, side, 0, 0, 0.1);
  const allowed = view.kind === "error" ? view.error : view.threshold * 3.9;
  expect([0, 1].map((i) => mustRefine(spheres, i, 1.01 * allowed, 0, view))).toEqual([true, false]);
  expect([0, 1].map((i) => mustRefine(spheres, i, 4.01 * allowed, 0, view))).toEqual([true, true]);
  expect(timesTooLarge(spheres, 0, 4.01 * allowed, view)).toBeCloseTo(4.01, 4);
  expect(timesTooLarge(spheres, 1, 4.01 * allowed, view)).toBeCloseTo(4.01 / 4, 4);
});

test.each([
  ["perspective", new PerspectiveCamera(60, 1, 0.1, 10)],
  ["orthographic", new OrthographicCamera(7, 9, 1, -1, 0.1, 10)],
])("a scene's view by a %s camera is a quarter wider than any part of a picture", (_, camera) => {
  camera.position.set(1, 2, 3);
  for (const [x, y] of [
    [450, 450],
    [0, 0],
    [900, 0],
  ] as const) {
    camera.setViewOffset(1000, 1000, x, y, 100, 100);
    camera.updateMatrixWorld();
    const settings = { camera, height: 100, pixelError: 1, offscreen: 4 };
    const { planes } = sceneViewOf(settings, new Matrix4());
    const isInside = (scale: number, depth: number) =>
      [-scale, scale].map((side) => {
        const corner = new Vector3(side, side, depth).unproject(camera);
        return !isSphereOutside(planes, Float32Array.of(...corner.toArray(), 0), 0);
      });
    for (const depth of [-0.9, 0.9]) {
      expect(isInside(1.24, depth)).toEqual([true, true]);
      expect(isInside(1.26, depth)).toEqual([false, false]);
    }
  }
});

test("a camera that has a matrix only is as good as any", () => {
  const settings = { height: 300, pixelError: 1, offscreen: 4 };
  for (const camera of [
    new PerspectiveCamera(40, 1.5, 0.1, 10),
    new OrthographicCamera(-3, 3, 2, -2, 0.1, 10),
  ]) {
    const plain = new Camera();
    plain.projectionMatrix.copy(camera.projectionMatrix);
    expect(viewOf({ ...settings, camera: plain }, new Matrix4())).toEqual(
      viewOf({ ...settings, camera }, new Matrix4()),
    );
  }
});

test("a skewed object is allowed no more than the error in pixels", () => {
  const camera = new OrthographicCamera(-1, 1, 1, -1, 0.1, 10);
  const near = new PerspectiveCamera(90, 1, 0.1, 10);
  const random = new Random(3);
  for (let round = 0; round < 50; ++round) {
    const world = new Matrix4();
    for (const i of [0, 1, 2, 4, 5, 6, 8, 9, 10]) world.elements[i] = random.below(200) / 100 - 1;
    const settings = { height: 2, pixelError: 1, offscreen: 1 };
    const flat = viewOf({ ...settings, camera }, world);
    const deep = viewOf({ ...settings, camera: near }, world);
    const lengths = Array.from({ length: 2000 }, () => {
      const v = new Vector3(...[0, 1, 2].map(() => random.below(2001) - 1000));
      return v.lengthSq() > 0 ? v.normalize().applyMatrix4(world).length() : 1;
    });
    const [low, high] = [Math.min(...lengths), Math.max(...lengths)];
    if (flat.kind === "error") expect(flat.error * high).toBeLessThan(1 + 1e-9);
    if (deep.kind === "camera")
      expect(deep.threshold).toBeLessThanOrEqual((low / high) * (1 + 1e-6));
  }
  const turned = new Matrix4().makeRotationX(1).scale(new Vector3(1, 2, 3));
  const view = viewOf({ camera, height: 2, pixelError: 1, offscreen: 1 }, turned);
  expect(view.kind === "error" && view.error).toBeCloseTo(1 / 3, 12);
});
