import { expect, test } from "vitest";
import { checkSlices } from "../../../packages/umbel/src/format/table_slices.js";
import { xxh64 } from "../../../packages/umbel/src/format/xxh64.js";

const STRIDE = 24;
const ROWS = 4096 + 900;
const SUMS = { stride: 8, offset: 8, count: 2 };
const TABLE = { stride: STRIDE, offset: 32, count: ROWS };

function tableWithSums(): DataView {
  const bytes = Uint8Array.from({ length: TABLE.offset + STRIDE * ROWS + 8 }, (_, i) => i * 7);
  const view = new DataView(bytes.buffer);
  for (let i = 0; i < 2; ++i) {
    const begin = TABLE.offset + i * 4096 * STRIDE;
    const end = Math.min(begin + 4096 * STRIDE, TABLE.offset + STRIDE * ROWS);
    const [high, low] = xxh64(bytes.subarray(begin, end));
    view.setUint32(SUMS.offset + 8 * i, low, true);
    view.setUint32(SUMS.offset + 8 * i + 4, high, true);
  }
  return view;
}

test("whole slices pass, and tables without checksums", () => {
  const view = tableWithSums();
  checkSlices(view, TABLE, SUMS);
  checkSlices(view, TABLE, undefined);
  checkSlices(view, TABLE, { ...SUMS, count: 0 });
});

test("a changed byte of any slice is noticed", () => {
  for (const row of [0, 4095, 4096, ROWS - 1]) {
    const view = tableWithSums();
    const at = TABLE.offset + STRIDE * row + 3;
    view.setUint8(at, view.getUint8(at) ^ 1);
    expect(() => checkSlices(view, TABLE, SUMS)).toThrow(/checksum of a slice/);
  }
});

test("another number of slices, and checksums past the end, are refused", () => {
  const view = tableWithSums();
  expect(() => checkSlices(view, TABLE, { ...SUMS, count: 1 })).toThrow(/number of slices/);
  const far = { ...SUMS, offset: view.byteLength - 8 };
  expect(() => checkSlices(view, TABLE, far)).toThrow(/damaged/);
});
