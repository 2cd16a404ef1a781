import { expect, test } from "vitest";
import { dividerAt, panesOf } from "../../../../app/src/viewport/layout.js";

test("side by side shows each whole picture in its half", () => {
  const [left, right] = panesOf("side", 0.9, 101, 50);
  expect(left).toEqual({ viewport: [0, 0, 51, 50], scissor: [0, 0, 51, 50] });
  expect(right).toEqual({ viewport: [51, 0, 50, 50], scissor: [51, 0, 50, 50] });
});

test("a wipe cuts two pictures of the whole canvas at the divider", () => {
  const [left, right] = panesOf("wipe", 0.25, 400, 50);
  expect(left).toEqual({ viewport: [0, 0, 400, 50], scissor: [0, 0, 100, 50] });
  expect(right).toEqual({ viewport: [0, 0, 400, 50], scissor: [100, 0, 300, 50] });
  expect(dividerAt("wipe", 0.25)).toBe(0.25);
});
