import { Matrix4, OrthographicCamera, PerspectiveCamera } from "three";
import { describe, expect, test } from "vitest";
import {
  isSamePose,
  pixelsPerUnit,
  poseOf,
  viewOf,
} from "../../../packages/umbel/src/three/camera_view.js";

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
