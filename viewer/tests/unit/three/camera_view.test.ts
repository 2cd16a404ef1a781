import { Matrix4, PerspectiveCamera } from "three";
import { describe, expect, test } from "vitest";
import { areSamePoses, posesOf } from "../../../packages/umbel/src/three/camera_view.js";

describe("a view", () => {
  const poses = (x: number, turn: number) => {
    const camera = new PerspectiveCamera(40, 1.5, 0.1, 10);
    camera.position.set(x, 0, 3e-6);
    camera.rotation.y = turn;
    camera.updateMatrixWorld();
    return posesOf(camera, new Matrix4());
  };

  test("is the same at rest, and another when the camera moves a little, however small all is", () => {
    const before = poses(1e-6, 0.3);
    expect(areSamePoses(poses(1e-6 * (1 + 1e-15), 0.3 + 1e-16), before)).toBe(true);
    expect(areSamePoses(poses(1.000001e-6, 0.3), before)).toBe(false);
    expect(areSamePoses(poses(1e-6, 0.300001), before)).toBe(false);
    expect(areSamePoses(before, [])).toBe(false);
  });
});
