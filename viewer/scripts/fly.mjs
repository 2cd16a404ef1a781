// Flies along a camera path through a folder that `umbel view --export` made, in headless Chromium:
//
//     node scripts/fly.mjs SITE PATH.json OUT
//
// The folder is served with HTTP ranges, by Vite's server for built pages. At each key of the path
// the camera waits until what it sees is there, or two seconds. OUT-1.jpg and on are pictures of
// every twentieth key. It prints one JSON object: bytes and requests, memory, and times.

import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { preview } from "vite";
import { launch } from "./chromium.mjs";
import { heapMeter } from "./heap.mjs";

const BUDGET = 512 * 2 ** 20;
const PATIENCE = 2000;
const [site, path, out] = process.argv.slice(2);
if (!out) throw new Error("usage: node scripts/fly.mjs SITE PATH.json OUT");
const { keys } = JSON.parse(readFileSync(path, "utf8"));

const server = await preview({
  root: resolve(site),
  configFile: false,
  logLevel: "error",
  build: { outDir: resolve(site) },
  preview: { port: 0, host: "127.0.0.1" },
});
const url = server.resolvedUrls.local[0];
const browser = await launch();
const page = await browser.newPage({ viewport: { width: 960, height: 600 } });
// Pictures by software take as long as they take.
page.setDefaultTimeout(300_000);
const measureHeap = await heapMeter(page);
let requests = 0;
page.on("request", (request) => {
  requests += /\.umbel$/.test(request.url()) ? 1 : 0;
});
const link = (key) => `eye=${key.position.join()}&target=${key.target.join()}&pixels=1`;
await page.goto(`${url}#${link(keys[0])}&budget=${BUDGET / 2 ** 20}`);
await page.waitForFunction(
  () => globalThis.umbelViewer?.viewport.meshes[0]?.statistics?.triangles > 0,
);
const first = await page.evaluate(() => {
  const [{ startTime, detail }] = performance.getEntriesByName("umbel-first-picture");
  return { time: startTime, bytes: detail.fetchedBytes };
});
const firstRequests = requests;

const steps = [];
for (const [k, key] of keys.entries()) {
  const step = await page.evaluate(
    async ([pose, patience]) => {
      const { viewport } = globalThis.umbelViewer;
      const [mesh] = viewport.meshes;
      viewport.camera.setPose(pose);
      const began = performance.now();
      let isSettled = false;
      // A few frames pass before the stream knows of the new view.
      for (let frames = 0; performance.now() - began < patience; ++frames) {
        await new Promise((next) => requestAnimationFrame(next));
        isSettled = frames > 4 && mesh.isSettled;
        if (isSettled) break;
      }
      const s = mesh.statistics;
      return {
        time: performance.now() - began,
        isSettled,
        select: s.selectTime,
        update: mesh.updateTime,
        fetched: s.fetchedBytes,
        geometry: s.residentBytes,
        textures: mesh.textures.bytes,
        scale: s.scale,
        triangles: mesh.drawn.triangles,
        calls: mesh.drawn.calls,
      };
    },
    [key, PATIENCE],
  );
  const heap = await measureHeap(false);
  steps.push({ ...step, page: heap.page, workers: heap.workers });
  if (k % 20 === 0) await page.screenshot({ path: `${out}-${1 + k / 20}.jpg`, quality: 80 });
}
const heap = await measureHeap(true);
const most = (name) => Math.max(...steps.map((step) => step[name]));
const median = (name) => steps.map((step) => step[name]).sort((a, b) => a - b)[steps.length >> 1];
process.stdout.write(
  `${JSON.stringify({
    keys: keys.length,
    settled: steps.filter((step) => step.isSettled).length,
    first_picture_ms: Math.round(first.time),
    first_picture_bytes: first.bytes,
    first_picture_requests: firstRequests,
    fetched_bytes: most("fetched"),
    requests,
    most_geometry_bytes: most("geometry"),
    most_texture_bytes: most("textures"),
    most_page_heap_bytes: most("page"),
    most_worker_heap_bytes: most("workers"),
    page_heap_bytes: heap.page,
    worker_heap_bytes: heap.workers,
    largest_error_factor: most("scale"),
    step_ms: Math.round(median("time")),
    select_ms: median("select"),
    update_ms: median("update"),
    most_triangles: most("triangles"),
    most_calls: most("calls"),
  })}\n`,
);
await browser.close();
await server.close();
