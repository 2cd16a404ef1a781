// Measures the viewer in headless Chromium, with WebGL2 in software:
//
//     umbel build dragon.ply -o dragon.umbel --precision 16bits
//     npm run measure -- dragon.umbel
//
// It prints one JSON object:
// - milliseconds from the start of loading until the first triangles are drawn, until all visible
//   materials have a texture of some size, and until the selected cut is drawn (medians of seven);
// - bytes of the asset and of the page received by then, beside those of the selected cut's pages;
// - milliseconds of the page's thread for a new cut, and of the worker for a selection;
// - the heap before and after a thousand cuts.

import { spawn } from "node:child_process";
import { resolve } from "node:path";
import { launch } from "./chromium.mjs";

const LOADS = 7;
const CUTS = 1000;

const [asset] = process.argv.slice(2);
if (!asset) throw new Error("usage: npm run measure -- FILE.umbel");
const server = spawn(process.env.UMBEL ?? "umbel", [
  "view",
  resolve(asset),
  "--no-browser",
  "--json",
]);
const url = await new Promise((found, failed) => {
  server.stdout.once("data", (line) => found(JSON.parse(line).url));
  server.once("error", failed);
});
const browser = await launch();

function median(numbers) {
  return numbers.sort((a, b) => a - b)[Math.floor(numbers.length / 2)];
}

async function load() {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
  const page = await context.newPage();
  await page.goto(url);
  await page.waitForFunction(() => {
    const mesh = globalThis.umbelViewer?.viewport.meshes[0];
    return mesh?.statistics?.isSettled && mesh.isSettled !== false && mesh.statistics.triangles > 0;
  });
  const first = await page.evaluate(() => {
    const [{ startTime, detail }] = performance.getEntriesByName("umbel-first-picture");
    const pageBytes = [
      ...performance.getEntriesByType("navigation"),
      ...performance.getEntriesByType("resource"),
    ]
      .filter(({ responseEnd, name }) => responseEnd <= startTime && !/\.umbel$/.test(name))
      .reduce((sum, { transferSize }) => sum + transferSize, 0);
    const [dressed] = performance.getEntriesByName("umbel-first-textures");
    const textures = dressed && { time: dressed.startTime, bytes: dressed.detail.fetchedBytes };
    return { time: startTime, fetchedBytes: detail.fetchedBytes, pageBytes, textures };
  });
  const settled = await page.evaluate(() => performance.now());
  return { page, context, first, settled };
}

const times = [];
const texturedTimes = [];
const settledTimes = [];
let last;
for (let i = 0; i < LOADS; ++i) {
  await last?.context.close();
  last = await load();
  times.push(last.first.time);
  texturedTimes.push(last.first.textures?.time ?? 0);
  settledTimes.push(last.settled);
}
const { page, first } = last;
const settled = await page.evaluate(() => globalThis.umbelViewer.viewport.meshes[0].statistics);
const cuts = await page.evaluate(async (count) => {
  const { viewport } = globalThis.umbelViewer;
  const [mesh] = viewport.meshes;
  const { position, target } = viewport.camera.pose;
  const heap = () => {
    gc();
    return performance.memory.usedJSHeapSize;
  };
  const work = [];
  const turn = async (i) => {
    const angle = i / 7;
    const d = position.map((x, axis) => x - target[axis]);
    const zoom = 0.7 + 0.6 * ((i * 0.618) % 1);
    viewport.camera.setPose({
      position: [
        target[0] + zoom * (d[0] * Math.cos(angle) - d[2] * Math.sin(angle)),
        target[1] + zoom * d[1],
        target[2] + zoom * (d[0] * Math.sin(angle) + d[2] * Math.cos(angle)),
      ],
      target,
    });
    const version = mesh.cutVersion;
    mesh.update(viewport.camera.perspective, viewport.renderer);
    for (let wait = 0; wait < 20 && mesh.cutVersion === version; ++wait) {
      await new Promise((next) => setTimeout(next, 2));
      mesh.update(viewport.camera.perspective, viewport.renderer);
    }
    work.push(mesh.updateTime);
  };
  for (let i = 0; i < 100; ++i) await turn(i);
  const before = heap();
  for (let i = 0; i < count; ++i) await turn(i);
  return { before, after: heap(), work: work.sort((a, b) => a - b)[work.length >> 1] };
}, CUTS);
process.stdout.write(
  `${JSON.stringify({
    first_picture_ms: Math.round(median(times)),
    first_picture_ms_all: times.map(Math.round),
    first_textures_ms: Math.round(median(texturedTimes)),
    first_textures_asset_bytes: first.textures?.bytes,
    settled_ms: Math.round(median(settledTimes)),
    first_picture_asset_bytes: first.fetchedBytes,
    first_picture_page_bytes: first.pageBytes,
    first_picture_bytes: first.fetchedBytes + first.pageBytes,
    fetched_bytes: settled.fetchedBytes,
    ideal_bytes: settled.wantedFileBytes,
    ratio: settled.fetchedBytes / settled.wantedFileBytes,
    select_ms_in_worker: settled.selectTime,
    page_thread_ms_per_cut: cuts.work,
    heap_bytes_before: cuts.before,
    heap_bytes_after: cuts.after,
  })}\n`,
);
await browser.close();
server.kill();
