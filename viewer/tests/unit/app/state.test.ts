import { expect, test } from "vitest";
import { defaultState, readLink, writeLink } from "../../../app/src/state.js";
import { translated } from "../../../app/src/viewport/camera.js";

const UTM = [448_250.125, 5_411_900.5, 312.0625] as const;

test("links resolve a millionth of the distance to the target, in the world", () => {
  Object.assign(globalThis, { matchMedia: () => ({ matches: false }) });
  const near = { position: [0.25, 1.5, 3.000125] as const, target: [0.125, -0.5, 0] as const };
  const pose = translated({ position: [...near.position], target: [...near.target] }, UTM, 1);
  const read = readLink(writeLink(defaultState(), pose), defaultState());
  const back = translated(read ?? pose, UTM, -1);
  for (let i = 0; i < 3; ++i) {
    expect(Math.abs(back.position[i] - near.position[i])).toBeLessThan(4e-6);
    expect(Math.abs(back.target[i] - near.target[i])).toBeLessThan(4e-6);
  }
});
