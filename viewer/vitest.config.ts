import { fileURLToPath } from "node:url";
import { defineConfig } from "vitest/config";

const SOURCE = fileURLToPath(new URL("./packages/umbel/src", import.meta.url));

export default defineConfig({
  // The page's modules import the package by its name; tests take its sources.
  resolve: { alias: { "umbel/three": `${SOURCE}/three/index.ts`, umbel: `${SOURCE}/index.ts` } },
  test: {
    include: ["tests/unit/**/*.test.ts"],
    globalSetup: ["tests/unit/setup.ts"],
    pool: "threads",
    testTimeout: 30_000,
  },
});
