import { existsSync } from "node:fs";
import { defineConfig } from "@playwright/test";

const CHROMIUM = process.env.UMBEL_CHROMIUM ?? "/usr/bin/chromium";
const isSkipped = !existsSync(CHROMIUM) && !process.env.CI;
if (isSkipped)
  process.stderr.write(`viewer: browser tests are skipped: ${CHROMIUM} does not exist\n`);

// The system's Chromium, with WebGL2 in software.
export default defineConfig({
  testDir: "tests/browser",
  // A browser may start slowly on a busy machine.
  retries: process.env.CI ? 2 : 0,
  testIgnore: isSkipped ? "**" : [],
  globalSetup: "./tests/browser/setup.ts",
  outputDir: "../build/viewer/browser",
  snapshotPathTemplate: "{testDir}/pictures/{arg}{ext}",
  workers: 1,
  timeout: 60_000,
  expect: { timeout: 20_000, toMatchSnapshot: { maxDiffPixelRatio: 0.02, threshold: 0.15 } },
  reporter: [["list"]],
  use: {
    viewport: { width: 720, height: 360 },
    colorScheme: "light",
    // Without damping of the camera: software draws frames slowly.
    contextOptions: { reducedMotion: "reduce" },
    launchOptions: {
      executablePath: CHROMIUM,
      args: [
        "--headless",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--js-flags=--expose-gc",
      ],
    },
  },
});
