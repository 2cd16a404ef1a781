// Fuzzes the viewer's readers. For longer, and with another seed:
//
//     SECONDS_EACH=600 SEED=1 npm run fuzz
//
// Inputs that fail are kept in build/viewer/fuzz. Every run of the tests reads those in
// tests/vectors/viewer.

import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { describe, expect, test } from "vitest";
import { corpus, fuzz } from "../fuzz/corpus.js";
import { show } from "../fuzz/drive.js";
import { ROOT } from "../support/assets.js";

const SECONDS = Number(process.env.SECONDS_EACH ?? 10);
const SEED = Number(process.env.SEED ?? 20);

function keep(file: Uint8Array, number: number): void {
  const folder = join(ROOT, "build/viewer/fuzz");
  mkdirSync(folder, { recursive: true });
  writeFileSync(join(folder, `${SEED}-${number}.umbel`), file);
}

describe("the viewer shows any file or throws an UmbelError", () => {
  const seeds = corpus();

  test.each(seeds)("$name", async ({ file }) => {
    await show(file);
  });

  test("files damaged at random", { timeout: 1000 * (SECONDS + 60) }, async () => {
    const errors: unknown[] = [];
    const inputs = await fuzz(seeds, SEED, 1000 * SECONDS, (file, error) => {
      keep(file, errors.length);
      errors.push(error);
    });
    expect(errors.slice(0, 5)).toEqual([]);
    expect(inputs).toBeGreaterThan(50);
    process.stdout.write(`viewer: ${inputs} inputs in ${SECONDS} s, no failure\n`);
  });
});
