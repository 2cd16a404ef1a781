import { expect, test } from "vitest";
import { PriorityQueue } from "../../../packages/umbel/src/stream/priority_queue.js";
import { Random } from "../../support/random.js";

test("values come out by falling priority", () => {
  const random = new Random(1);
  const queue = new PriorityQueue();
  const priorities = Array.from({ length: 300 }, () => random.below(50));
  priorities.forEach((priority, value) => {
    queue.push(priority, value);
  });
  const found: number[] = [];
  for (let next = queue.pop(); next; next = queue.pop()) {
    expect(next.priority).toBe(priorities[next.value]);
    found.push(next.priority);
  }
  expect(found).toEqual([...priorities].sort((a, b) => b - a));
});
