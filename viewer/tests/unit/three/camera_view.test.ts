import { Matrix4, PerspectiveCamera } from "three";
import { describe, expect, test } from "vitest";
import { isSamePose, poseOf } from "../../../packages/umbel/src/three/camera_view.js";

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
