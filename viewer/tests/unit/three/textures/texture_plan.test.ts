import { describe, expect, test } from "vitest";
import {
  type PlannedImage,
  planSizes,
} from "../../../../packages/umbel/src/three/textures/texture_plan.js";
import { Random } from "../../../support/random.js";

function image(wanted: number, size = 0, full = 4096, smallest = 256): PlannedImage {
  return { wanted, size, smallest, full, bytesOf: (side) => Math.ceil((16 / 3) * side * side) };
}

describe("the plan", () => {
  test("halves the full size while that suffices", () => {
    const wanted = [1, 256, 257, 1000, 2049, 1e9, Infinity];
    const sizes = planSizes(
      wanted.map((texels) => image(texels)),
      Infinity,
    );
    expect(sizes).toEqual([256, 256, 512, 1024, 4096, 4096, 4096]);
  });

  test("loads nothing that is not visible, and keeps what is resident", () => {
    expect(planSizes([image(0), image(0, 512), image(300, 2048)], Infinity)).toEqual([
      0, 512, 2048,
    ]);
  });

  test("keeps the limit, and shrinks the most oversized images first", () => {
    const random = new Random(7);
    for (let round = 0; round < 50; ++round) {
      const images = Array.from({ length: 20 }, () =>
        image(
          random.unit() < 0.3 ? 0 : 4096 * random.unit(),
          random.unit() < 0.5 ? 0 : 2 ** Math.ceil(8 + 4 * random.unit()),
        ),
      );
      const limit = 5e6 + 2e8 * random.unit();
      const sizes = planSizes(images, limit);
      const bytes = images.reduce((sum, each, i) => sum + each.bytesOf(sizes[i]), 0);
      const isLeast = images.every(
        ({ smallest, size }, i) => sizes[i] <= Math.max(smallest, Math.min(size, smallest)),
      );
      expect(bytes <= limit || isLeast).toBe(true);
      images.forEach(({ wanted, smallest }, i) => {
        if (wanted > 0) expect(sizes[i]).toBeGreaterThanOrEqual(smallest);
      });
      // Invisible images have their smallest size while a visible one is too small.
      const isShort = images.some(
        ({ wanted }, i) => wanted > 0 && sizes[i] < wanted && sizes[i] < 4096,
      );
      if (isShort)
        images.forEach(({ wanted, size, smallest }, i) => {
          if (wanted === 0 && size > 0) expect(sizes[i]).toBeLessThanOrEqual(smallest);
        });
    }
  });
});
