// The seeds of the fuzzer, and its loop.

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { ROOT } from "../support/assets.js";
import { Random } from "../support/random.js";
import { show } from "./drive.js";
import { mutated } from "./mutate.js";

const FOLDERS = ["viewer", "format3", "format4", "format5"].map((name) =>
  join(ROOT, "tests/vectors", name),
);

/** Small assets of each kind, of all versions of the format, and all inputs that ever failed. */
export function corpus(): { name: string; file: Uint8Array }[] {
  return FOLDERS.flatMap((folder) =>
    readdirSync(folder)
      .filter((name) => name.endsWith(".umbel"))
      .sort()
      .map((name) => ({ name, file: new Uint8Array(readFileSync(join(folder, name))) })),
  );
}

/** Shows damaged files until so many milliseconds are over; returns how many. */
export async function fuzz(
  seeds: readonly { file: Uint8Array }[],
  seed: number,
  time: number,
  onFailure: (file: Uint8Array, error: unknown) => void,
): Promise<number> {
  const random = new Random(seed);
  const end = performance.now() + time;
  let inputs = 0;
  for (; performance.now() < end; ++inputs) {
    const file = mutated(random.of(seeds).file, random);
    try {
      await show(file, inputs % 6 === 0);
    } catch (error) {
      onFailure(file, error);
    }
  }
  return inputs;
}
