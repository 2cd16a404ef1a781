// Damages an asset at random, and updates its checksums: the damage is to pass them.

import { xxh64 } from "../../packages/umbel/src/format/xxh64.js";
import type { Random } from "../support/random.js";
import {
  fileHeaderSections,
  jsonSection,
  sealFileHeader,
  withSections,
} from "../support/rewrite.js";

const WORDS = [0, 1, 2, 0x7f, 0xff, 0xffff, 0x10000, 0x7fffffff, 0x80000000, 0xffffffff];
const FLOATS = [0, -0, 1, -1, Number.NaN, Infinity, -Infinity, 1e-45, 3.4e38, -3.4e38];
const VALUES = [null, true, -1, 0, 2, 1e30, "", "x", "data:,", [], {}, [[]], [null, 1]];

function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** Changes a few bytes from `first` on. */
function damage(bytes: Uint8Array, first: number, end: number, random: Random): void {
  if (end - first < 8) return;
  const view = viewOf(bytes);
  for (let i = 0; i <= random.below(4); ++i) {
    const at = first + random.below(end - first - 4);
    const aligned = first + 4 * random.below(Math.floor((end - first) / 4));
    const kind = random.below(6);
    if (kind === 0) bytes[at] ^= 1 << random.below(8);
    else if (kind === 1) bytes[at] = random.below(256);
    else if (kind === 2) view.setUint32(aligned, random.of(WORDS), true);
    else if (kind === 3) view.setFloat32(aligned, random.of(FLOATS), true);
    else if (kind === 4)
      view.setUint32(aligned, view.getUint32(aligned, true) + random.below(5) - 2, true);
    else bytes.copyWithin(at, first + random.below(end - first), Math.min(at + 64, end));
  }
}

/** Another value somewhere in JSON. */
function changed(value: unknown, random: Random): unknown {
  if (typeof value !== "object" || value === null || random.below(6) === 0)
    return random.of(VALUES);
  const keys = Object.keys(value);
  if (keys.length === 0) return random.of(VALUES);
  const copy: Record<string, unknown> | unknown[] = Array.isArray(value)
    ? [...value]
    : { ...value };
  const key = random.of(keys) as keyof typeof copy;
  copy[key] = changed((value as typeof copy)[key], random) as never;
  return copy;
}

function changeJson(file: Uint8Array, random: Random): Uint8Array {
  const name = random.of(["MTRL", "MTRL", "SCEN"]);
  const section = fileHeaderSections(file).find((each) => each.name === name);
  if (!section) return withSections(file, [jsonSection(name, random.of(VALUES))]);
  let value: unknown = JSON.parse(new TextDecoder().decode(section.bytes) || "{}");
  for (let i = 0; i <= random.below(3); ++i) value = changed(value, random);
  return withSections(file, [jsonSection(name, value)]);
}

/** The pages of the section PAGE that lie in the file. */
function pagesOf(file: Uint8Array): { row: number; offset: number; size: number }[] {
  const view = viewOf(file);
  const header = view.getUint32(12, true);
  for (let i = 0; i < view.getUint32(40, true); ++i) {
    const entry = header + 40 * i;
    if (String.fromCharCode(...file.subarray(entry, entry + 4)) !== "PAGE") continue;
    const [offset, count] = [8, 24].map((at) => Number(view.getBigUint64(entry + at, true)));
    const fits = Math.max(Math.floor((file.length - (offset as number)) / 24), 0);
    return Array.from({ length: Math.min(count as number, fits) }, (_, page) => {
      const row = (offset as number) + 24 * page;
      const begin = Number(view.getBigUint64(row, true));
      return { row, offset: begin, size: view.getUint32(row + 8, true) };
    }).filter(({ offset: begin, size }) => begin + size <= file.length);
  }
  return [];
}

function sealPage(file: Uint8Array, row: number, offset: number, size: number): void {
  const [high, low] = xxh64(file.subarray(offset, offset + size));
  viewOf(file).setUint32(row + 16, low, true);
  viewOf(file).setUint32(row + 20, high, true);
}

function changePage(file: Uint8Array, random: Random): void {
  const pages = pagesOf(file);
  if (pages.length === 0) return;
  const { row, offset, size } = random.of(pages);
  // Half of the time only the records before the geometry.
  const reach = random.below(2) ? size : Math.min(size, 16 + 64 + 256);
  damage(file, offset, offset + reach, random);
  sealPage(file, row, offset, size);
}

/** A damaged copy of an asset, whose file header and pages have valid checksums. */
export function mutated(seed: Uint8Array, random: Random): Uint8Array {
  let file: Uint8Array = Uint8Array.from(seed);
  for (let i = 0; i <= random.below(2); ++i) {
    const kind = random.below(8);
    const head = Math.min(Number(viewOf(file).getBigUint64(24, true)), file.length);
    if (kind < 4) changePage(file, random);
    else if (kind < 6) damage(file, 12, head, random);
    else if (kind === 6 && i === 0) file = changeJson(file, random);
    else file = file.slice(0, 128 + random.below(file.length - 128));
    if (viewOf(file).getUint32(12, true) !== 128 || file.length < head) return file;
    sealFileHeader(file);
  }
  return file;
}
