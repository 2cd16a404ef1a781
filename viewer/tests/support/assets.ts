// The tests' assets. The Python package makes them, once for each version of the library and of the
// scripts.

import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { existsSync, readdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

export const ROOT = resolve(dirname(fileURLToPath(import.meta.url)), "../../..");
export const ASSETS = join(ROOT, "build/viewer/assets");
export const PYTHON = process.env.UMBEL_PYTHON ?? join(ROOT, ".venv/bin/python");

function stampOf(script: string): string {
  const helpers = join(ROOT, "tests/python/helpers");
  const reader = readFileSync(join(helpers, "reference_reader.py"));
  const codec = readFileSync(join(helpers, "reference_codec.py"));
  const textured = readFileSync(join(ROOT, "viewer/tests/support/make_textured.py"));
  const where = execFileSync(PYTHON, ["-c", "import umbel._umbel as m; print(m.__file__)"]);
  const library = statSync(where.toString().trim());
  return createHash("sha256")
    .update(readFileSync(script))
    .update(reader)
    .update(codec)
    .update(textured)
    .update(`${library.mtimeMs} ${library.size}`)
    .digest("hex");
}

export function makeAssets(): void {
  const script = join(ROOT, "viewer/tests/support/make_assets.py");
  const stamp = stampOf(script);
  const file = join(ASSETS, "stamp");
  if (existsSync(file) && readFileSync(file, "utf-8") === stamp) return;
  execFileSync(PYTHON, [script, ASSETS], { stdio: "inherit" });
  writeFileSync(file, stamp);
}

/** The assets that the reference reader has decoded. */
export function assetNames(): string[] {
  return readdirSync(ASSETS)
    .filter(
      (name) =>
        name.endsWith(".umbel") && existsSync(join(ASSETS, name.replace(".umbel", ".json"))),
    )
    .map((name) => name.slice(0, -".umbel".length))
    .sort();
}

export function assetBytes(name: string): Uint8Array {
  return new Uint8Array(readFileSync(join(ASSETS, `${name}.umbel`)));
}

/** An asset as the reference reader and the library read it. */
export interface ExpectedAsset {
  levels: [number, number][];
  source_triangles: number;
  groups: number;
  triangles: string;
  pages: Record<string, ExpectedGroup[]>;
  views: ExpectedView[];
}

export interface ExpectedGroup {
  group: number;
  mesh: number;
  first_cluster: number;
  level: number;
  method: number;
  parents: number;
  /** Centre, radius, error. */
  sphere: string;
  references: [number, number, number][];
  made_from: number[];
  materials: number[];
  boxes: string;
  clusters: Record<string, string>[];
}

export interface ExpectedView {
  kind: "error" | "level" | "camera";
  error: number;
  level: number;
  eye: [number, number, number];
  fov_y: number;
  height: number;
  pixel_error: number;
  cut: string;
}

export function expectedOf(name: string): ExpectedAsset {
  return JSON.parse(readFileSync(join(ASSETS, `${name}.json`), "utf-8")) as ExpectedAsset;
}

export function words(base64: string): Uint32Array {
  return new Uint32Array(new Uint8Array(Buffer.from(base64, "base64")).buffer);
}

export function floats(base64: string): Float32Array {
  return new Float32Array(words(base64).buffer);
}
