import { expect, test } from "vitest";
import { xxh64 } from "../../../packages/umbel/src/format/xxh64.js";

test("gives the checksums of the specification", () => {
  const hex = (text: string) =>
    xxh64(new TextEncoder().encode(text))
      .map((half) => half.toString(16).padStart(8, "0"))
      .join("");
  expect(hex("")).toBe("ef46db3751d8e999");
  expect(hex("a")).toBe("d24ec4f1a98c6e5b");
  expect(hex("abc")).toBe("44bc2cf5ad770999");
  expect(hex("Nobody inspects the spammish repetition")).toBe("fbcea83c8a378bf1");
});
