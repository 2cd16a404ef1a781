// Little-endian values of typed arrays that the file stores.

import { corrupt } from "../errors.js";

export function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** Reads a u64 that must fit into 53 bits, as every size of a real file does. */
export function readU64(view: DataView, at: number): number {
  const value = view.getUint32(at + 4, true) * 0x100000000 + view.getUint32(at, true);
  if (!Number.isSafeInteger(value)) corrupt("The file is damaged: it names an impossible size.");
  return value;
}

export function readFloats(view: DataView, at: number, count: number): Float32Array {
  return Float32Array.from({ length: count }, (_, i) => view.getFloat32(at + 4 * i, true));
}
