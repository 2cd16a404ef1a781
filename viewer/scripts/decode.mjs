// Measures the two decoders, WebAssembly and TypeScript, in Node, by turns:
//
//     npm run decode -- FILE.umbel ...
//
// For each file and decoder it prints the least and the median time for all pages, in milliseconds,
// and millions of triangles a second at the median.

import { readFileSync } from "node:fs";
import { basename } from "node:path";
import { loadWasm, readFileHeader, readPage } from "../packages/umbel/dist/index.js";

const TURNS = 25;

await loadWasm(
  readFileSync(new URL("../packages/umbel/dist/decode/decoder.wasm", import.meta.url)),
);
for (const name of process.argv.slice(2)) {
  const file = new Uint8Array(readFileSync(name));
  const header = readFileHeader(file);
  const { offset, size, count } = header.pages;
  const times = { wasm: [], typescript: [] };
  let triangles = 0;
  for (let turn = 0; turn < TURNS; ++turn)
    for (const [decoder, all] of Object.entries(times)) {
      const begin = performance.now();
      triangles = 0;
      for (let page = 0; page < count; ++page) {
        const bytes = file.subarray(offset[page], offset[page] + size[page]);
        for (const { indices } of readPage(header, page, bytes, decoder === "wasm"))
          triangles += indices.length / 3;
      }
      all.push(performance.now() - begin);
    }
  for (const [decoder, all] of Object.entries(times)) {
    const [least, median] = [all.sort((a, b) => a - b)[0], all[TURNS >> 1]];
    const rate = (triangles / median / 1000).toFixed(1);
    process.stdout.write(
      `${basename(name)} ${decoder}: ${least.toFixed(1)} ms, ${median.toFixed(1)} ms, ${rate} M/s\n`,
    );
  }
}
