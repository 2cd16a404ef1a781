import { PerspectiveCamera } from "three";
import { afterEach, expect, test, vi } from "vitest";
import { TexelDemand } from "../../../../packages/umbel/src/three/textures/texel_demand.js";

afterEach(() => {
  vi.useRealTimers();
});

test("a measurement that comes too soon is asked for again, unless it is disposed of", () => {
  vi.useFakeTimers();
  const [measured, again] = [vi.fn(), vi.fn()];
  const twice = () => {
    const demand = new TexelDemand();
    for (const view of ["first", "second"])
      demand.update([], new PerspectiveCamera(), 100, view, { measured, again });
    return demand;
  };
  twice();
  vi.advanceTimersByTime(1000);
  expect(measured).toHaveBeenCalledTimes(1);
  expect(again).toHaveBeenCalledTimes(1);
  twice().dispose();
  vi.advanceTimersByTime(1000);
  expect(again).toHaveBeenCalledTimes(1);
});
