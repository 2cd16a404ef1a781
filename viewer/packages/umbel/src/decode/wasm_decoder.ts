// Decodes the clusters of a group by the library's own code, compiled to WebAssembly (wasm/). Until
// that is loaded, where it may not run (a Content-Security-Policy, an old browser), and where it
// finds the data damaged, the caller decodes in TypeScript, which gives the same and says what is
// wrong.

import type { Attribute } from "../format/attributes.js";
import { BIT_PADDING } from "./bit_reader.js";
import type { ChunkTables } from "./chunk_tables.js";

/** What group_decoder.cpp exports. Numbers are addresses in its memory. */
interface Exports {
  memory: WebAssembly.Memory;
  reserve(bytes: number): number;
  decode(words: number, chunk: number, indices: number, rows: number): void;
  _initialize?(): void;
}

export interface DecodedClusters {
  /** Three vertices a triangle, counted from the group's first. */
  indices: Uint32Array;
  /** The vertices' integers, `stride` each. Valid until the next call. */
  rows: Int32Array;
  stride: number;
}

/** More memory than this is given back after a group: memory of WebAssembly never shrinks. */
const MOST_KEPT_BYTES = 64 << 20;
/** Groups that would take more are decoded in TypeScript: addresses stay below 2^31. */
const MOST_BYTES = 1 << 30;
const WORDS_OF_ATTRIBUTE = 7;
const WORDS_OF_HEAD = 6;

/** The module is loaded once so many bytes have been decoded: fewer are not worth its own. */
const LOADED_AFTER_BYTES = 1 << 20;

let decodedBytes = 0;
let loading: Promise<void> | undefined;
let module: WebAssembly.Module | undefined;
let instance: Exports | undefined;

async function fetched(): Promise<ArrayBuffer> {
  return (await fetch(new URL("./decoder.wasm", import.meta.url))).arrayBuffer();
}

async function load(code?: BufferSource): Promise<void> {
  try {
    module = await WebAssembly.compile(code ?? (await fetched()));
  } catch {
    // It may not run, or did not arrive: TypeScript decodes on.
  }
}

/**
 * Loads the module, if that has not begun; resolves when it is there, or cannot be.
 * @param code the bytes of decoder.wasm, where they cannot be fetched, as in Node
 */
export function loadWasm(code?: BufferSource): Promise<void> {
  if (loading === undefined || code !== undefined) loading = load(code);
  return loading;
}

function decoder(): Exports | undefined {
  if (instance === undefined && module !== undefined) {
    instance = new WebAssembly.Instance(module).exports as unknown as Exports;
    instance._initialize?.();
  }
  return instance;
}

/** Rounds up to whole vectors of 16 bytes. */
function aligned(bytes: number): number {
  return 16 * Math.ceil(bytes / 16);
}

/** The words that `decode` reads. */
function describe(
  into: ArrayBufferLike,
  at: number,
  version: number,
  attributes: readonly Attribute[],
  tables: ChunkTables,
  chunkBytes: number,
): void {
  const { ranges, vertices, triangles, ends } = tables;
  const view = new DataView(into, at);
  let next = 0;
  const put = (word: number) => {
    view.setUint32(next, word, true);
    next += 4;
  };
  put(version);
  put(attributes.length);
  put(ranges.bits.length);
  put(vertices.length);
  put(tables.dataAt);
  put(chunkBytes);
  for (const { kind, set, coding, bits, step, components, isSmooth } of attributes) {
    put(kind);
    put(set);
    put(coding);
    put(bits);
    view.setFloat32(next, step, true);
    next += 4;
    put(components);
    put(isSmooth ? 1 : 0);
  }
  ranges.bits.forEach((width, i) => {
    put(ranges.lowest[i]);
    put(width);
  });
  vertices.forEach((count, i) => {
    put(count);
    put(triangles[i]);
    put(ends[i]);
  });
}

/**
 * Decodes all clusters of a chunk, which have so many vertices and triangles. Undefined where the
 * module is not there, or the data are damaged.
 * @param chunk the group's chunk, with BIT_PADDING bytes behind it
 */
export function decodeClusters(
  version: number,
  attributes: readonly Attribute[],
  tables: ChunkTables,
  chunk: DataView,
  vertexCount: number,
  triangleCount: number,
): DecodedClusters | undefined {
  const parts = tables.ranges.bits.length;
  const stride = (parts + 3) & ~3;
  const words =
    WORDS_OF_HEAD + WORDS_OF_ATTRIBUTE * attributes.length + 2 * parts + 3 * tables.vertices.length;
  const chunkAt = aligned(4 * words);
  const indicesAt = chunkAt + aligned(chunk.byteLength);
  const rowsAt = indicesAt + aligned(12 * triangleCount);
  const bytes = rowsAt + 4 * stride * vertexCount;
  decodedBytes += chunk.byteLength;
  if (decodedBytes > LOADED_AFTER_BYTES) void loadWasm();
  try {
    const to = decoder();
    if (to === undefined || bytes > MOST_BYTES) return undefined;
    const base = to.reserve(bytes);
    const { buffer } = to.memory;
    describe(buffer, base, version, attributes, tables, chunk.byteLength - BIT_PADDING);
    const source = new Uint8Array(chunk.buffer, chunk.byteOffset, chunk.byteLength);
    new Uint8Array(buffer, base + chunkAt, source.length).set(source);
    to.decode(base, base + chunkAt, base + indicesAt, base + rowsAt);
    // The memory may have grown.
    const memory = to.memory.buffer;
    if (memory.byteLength > MOST_KEPT_BYTES) instance = undefined;
    return {
      indices: new Uint32Array(memory, base + indicesAt, 3 * triangleCount).slice(),
      rows: new Int32Array(memory, base + rowsAt, stride * vertexCount),
      stride,
    };
  } catch {
    // A trap of the module, or no room for its memory, for which browsers have several errors.
    instance = undefined;
    return undefined;
  }
}
