import { defineConfig } from "vitest/config";

export default defineConfig({
  test: {
    include: ["tests/unit/**/*.test.ts"],
    globalSetup: ["tests/unit/setup.ts"],
    pool: "threads",
    testTimeout: 30_000,
  },
});
