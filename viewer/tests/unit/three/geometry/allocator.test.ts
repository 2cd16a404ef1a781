import { expect, test } from "vitest";
import { Allocator } from "../../../../packages/umbel/src/three/geometry/allocator.js";
import { Random } from "../../../support/random.js";

test("allocations never overlap, and freed ranges merge again", () => {
  const random = new Random(3);
  const capacity = 500;
  const allocator = new Allocator(capacity);
  const isTaken = new Uint8Array(capacity);
  const allocations: { start: number; count: number }[] = [];
  for (let i = 0; i < 2000; ++i) {
    if (random.below(2)) {
      const count = 1 + random.below(40);
      const start = allocator.allocate(count);
      if (start < 0) continue;
      expect(start + count).toBeLessThanOrEqual(capacity);
      expect(isTaken.subarray(start, start + count).every((taken) => taken === 0)).toBe(true);
      isTaken.fill(1, start, start + count);
      allocations.push({ start, count });
    } else {
      const [freed] = allocations.splice(random.below(allocations.length || 1), 1);
      if (!freed) continue;
      allocator.free(freed.start, freed.count);
      isTaken.fill(0, freed.start, freed.start + freed.count);
    }
  }
  for (const { start, count } of allocations) allocator.free(start, count);
  expect(allocator.isEmpty).toBe(true);
  expect(allocator.allocate(capacity)).toBe(0);
  expect(allocator.allocate(1)).toBe(-1);
});
