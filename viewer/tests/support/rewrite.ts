// Rewrites an asset: with other sections in its file header, or other bytes in its pages, and with
// valid checksums.

import { xxh64 } from "../../packages/umbel/src/format/xxh64.js";

export interface Section {
  name: string;
  stride: number;
  bytes: Uint8Array;
}

const TABLE_ROW = 40;
const ALIGNED = 4096;

function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

function size(view: DataView, at: number): number {
  return Number(view.getBigUint64(at, true));
}

function setSize(view: DataView, at: number, value: number): void {
  view.setBigUint64(at, BigInt(value), true);
}

function setChecksum(view: DataView, at: number, bytes: Uint8Array): void {
  const [high, low] = xxh64(bytes);
  view.setUint32(at, low, true);
  view.setUint32(at + 4, high, true);
}

/** Updates the checksums of a file's header. */
export function sealFileHeader(file: Uint8Array): void {
  const view = viewOf(file);
  const header = view.getUint32(12, true);
  setChecksum(view, 32, file.subarray(header, size(view, 24)));
  setChecksum(view, header - 8, file.subarray(0, header - 8));
}

/** The sections in the file header. */
export function fileHeaderSections(file: Uint8Array): Section[] {
  const view = viewOf(file);
  const header = view.getUint32(12, true);
  return Array.from({ length: view.getUint32(40, true) }, (_, i) => {
    const row = header + TABLE_ROW * i;
    const name = String.fromCharCode(...file.subarray(row, row + 4));
    const offset = size(view, row + 8);
    // The hierarchy lies after the pages.
    const bytes =
      name === "NODE" ? new Uint8Array(0) : file.slice(offset, offset + size(view, row + 16));
    return { name, stride: view.getUint32(row + 4, true), bytes };
  });
}

/** The file with some sections changed or added. */
export function withSections(file: Uint8Array, changed: readonly Section[]): Uint8Array {
  const old = viewOf(file);
  const header = old.getUint32(12, true);
  const oldHead = size(old, 24);
  const names = new Set(changed.map(({ name }) => name));
  const sections = [...fileHeaderSections(file).filter(({ name }) => !names.has(name)), ...changed];
  let end = header + TABLE_ROW * sections.length;
  const offsets = sections.map(({ bytes }) => {
    const offset = Math.ceil(end / 8) * 8;
    end = offset + bytes.length;
    return offset;
  });
  const head = Math.ceil(end / ALIGNED) * ALIGNED;
  const moved = head - oldHead;
  const out = new Uint8Array(file.length + moved);
  out.set(file.subarray(0, header));
  out.set(file.subarray(oldHead), head);
  const view = viewOf(out);
  sections.forEach(({ name, stride, bytes }, i) => {
    const row = header + TABLE_ROW * i;
    out.set(new TextEncoder().encode(name), row);
    if (name === "NODE") {
      out.set(nodeRow(file), row);
      setSize(view, row + 8, size(view, row + 8) + moved);
      return;
    }
    view.setUint32(row + 4, stride, true);
    setSize(view, row + 8, offsets[i] as number);
    setSize(view, row + 16, bytes.length);
    setSize(view, row + 24, bytes.length / stride);
    setChecksum(view, row + 32, bytes);
    out.set(bytes, offsets[i]);
    if (name === "PAGE" || name === "FILE")
      for (let at = 0; at < bytes.length; at += stride) {
        const place = (offsets[i] as number) + at;
        setSize(view, place, size(view, place) + moved);
      }
  });
  setSize(view, 16, out.length);
  setSize(view, 24, head);
  view.setUint32(40, sections.length, true);
  sealFileHeader(out);
  return out;
}

function nodeRow(file: Uint8Array): Uint8Array {
  const view = viewOf(file);
  const header = view.getUint32(12, true);
  const rows = Array.from({ length: view.getUint32(40, true) }, (_, i) => header + TABLE_ROW * i);
  const row = rows.find((at) => String.fromCharCode(...file.subarray(at, at + 4)) === "NODE") ?? 0;
  return file.slice(row, row + TABLE_ROW);
}

export function jsonSection(name: string, value: unknown): Section {
  return { name, stride: 1, bytes: new TextEncoder().encode(JSON.stringify(value)) };
}

export function originSection(...origin: number[]): Section {
  return { name: "ORIG", stride: 24, bytes: new Uint8Array(Float64Array.from(origin).buffer) };
}
