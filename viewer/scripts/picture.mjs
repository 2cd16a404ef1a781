// Makes docs/images/viewer.jpg: an asset in four view modes, by the built page in headless Chromium.
//
//     umbel build dragon.ply -o dragon.umbel --precision 16bits
//     npm run picture -- dragon.umbel
//
// It asks `umbel view` for the page, so that command must be on the path, or named by UMBEL.

import { spawn } from "node:child_process";
import { writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { launch } from "./chromium.mjs";

const OUT = fileURLToPath(new URL("../../docs/images/viewer.jpg", import.meta.url));
const WIDTH = 640;
const HEIGHT = 460;
const CAMERA = "eye=-0.17,0.185,0.17&target=-0.005,0.117,0";
const CLOSE = "eye=-0.14,0.165,0.075&target=-0.03,0.125,0";
const VIEWS = [
  `${CAMERA}&mode=shaded&pixels=1`,
  `${CAMERA}&mode=shaded&pixels=6&wireframe=1`,
  `${CAMERA}&mode=clusters&pixels=6`,
  `${CLOSE}&mode=levels&pixels=2`,
];

const [asset] = process.argv.slice(2);
if (!asset) throw new Error("usage: npm run picture -- FILE.umbel");
const command = process.env.UMBEL ?? "umbel";
const server = spawn(command, ["view", resolve(asset), "--no-browser", "--json"]);
const url = await new Promise((found, failed) => {
  server.stdout.once("data", (line) => found(JSON.parse(line).url));
  server.once("error", failed);
});
const browser = await launch();
const page = await browser.newPage({
  viewport: { width: WIDTH + 300, height: HEIGHT },
  deviceScaleFactor: 1.5,
  colorScheme: "light",
});
const pictures = [];
for (const view of VIEWS) {
  await page.goto("about:blank");
  await page.goto(`${url}#${view}`);
  await page.waitForFunction(() => {
    const statistics = globalThis.umbelViewer?.viewport.meshes[0]?.statistics;
    return statistics?.isSettled && statistics.triangles > 0;
  });
  await page.waitForTimeout(1500);
  const png = await page.locator(".viewport canvas").screenshot({
    style: ".title, .progress, .notice { visibility: hidden }",
  });
  pictures.push(png.toString("base64"));
}
const jpeg = await page.evaluate(async (all) => {
  const images = await Promise.all(
    all.map(async (data) =>
      createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob()),
    ),
  );
  const [{ width, height }] = images;
  const gap = 6;
  const canvas = new OffscreenCanvas(2 * width + gap, 2 * height + gap);
  const context = canvas.getContext("2d");
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, canvas.width, canvas.height);
  images.forEach((image, i) => {
    context.drawImage(image, (i % 2) * (width + gap), Math.floor(i / 2) * (height + gap));
  });
  const blob = await canvas.convertToBlob({ type: "image/jpeg", quality: 0.86 });
  return [...new Uint8Array(await blob.arrayBuffer())];
}, pictures);
writeFileSync(OUT, Uint8Array.from(jpeg));
await browser.close();
server.kill();
