// The system's Chromium without a window, with WebGL 2 in software.

import { chromium } from "@playwright/test";

/** Starts it; pages may call `gc()`. */
export function launch() {
  return chromium.launch({
    executablePath: process.env.UMBEL_CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--headless",
      "--no-sandbox",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--js-flags=--expose-gc",
    ],
  });
}
