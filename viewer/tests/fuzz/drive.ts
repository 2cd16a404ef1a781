// Does what the viewer does with a file, without a browser: reads header and pages, selects, streams,
// packs for the GPU and makes materials. It may succeed or throw an UmbelError, and nothing else.

import { readPage } from "../../packages/umbel/src/decode/page.js";
import { UmbelError } from "../../packages/umbel/src/errors.js";
import { type FileHeader, readFileHeader } from "../../packages/umbel/src/format/file_header.js";
import { jsonOf, listOf } from "../../packages/umbel/src/format/gltf.js";
import { packGroup } from "../../packages/umbel/src/pack/render_group.js";
import { GroupDag } from "../../packages/umbel/src/select/group_dag.js";
import { cameraView } from "../../packages/umbel/src/select/select.js";
import { BlobSource } from "../../packages/umbel/src/source/source.js";
import { Streamer } from "../../packages/umbel/src/stream/streamer.js";
import { makeMaterial } from "../../packages/umbel/src/three/materials/material_maker.js";
import {
  PHYSICAL,
  STANDARD,
  textureInfo,
} from "../../packages/umbel/src/three/materials/material_slots.js";
import { channelOf, repeatsOf } from "../../packages/umbel/src/three/textures/sampler.js";
import { StreamedImage } from "../../packages/umbel/src/three/textures/streamed_image.js";
import { allocated } from "./watch.js";

/** Limits of memory: words for each number that a page's clusters state, and bytes of the header's. */
const WORDS_EACH = 8;
const HEADER_FACTOR = 64;
const SPARE = 1 << 16;
/** Milliseconds that an input may take, on a busy machine. */
export const MOST_TIME = 4000;
const LAYOUT = { normals: true, tangents: false, uvs: [true, true, true, true], colors: true };

function attempt(action: () => void): void {
  try {
    action();
  } catch (error) {
    if (!(error instanceof UmbelError)) throw error;
  }
}

/** Number of values that the clusters of a page state. */
function statedNumbers(header: FileHeader, page: number, bytes: Uint8Array): number {
  const { maxVertices, maxTriangles } = header.fixed;
  const components = Math.max(...header.meshes.map(({ smooth }) => smooth.length), 1);
  const clusters = Math.min(bytes.length / 24, header.clusters + header.pages.groups[page]);
  return (
    clusters *
    (Math.min(maxVertices, 256) * (components + 8) + 3 * Math.min(maxTriangles, 256) + 40)
  );
}

function readPages(file: Uint8Array, header: FileHeader): void {
  const dag = new GroupDag(header);
  for (let page = 0; page < header.pages.count; ++page)
    attempt(() => {
      const { offset, size } = header.pages;
      const bytes = file.subarray(offset[page], offset[page] + size[page]);
      const most = 4 * WORDS_EACH * statedNumbers(header, page, bytes) + 4 * bytes.length + SPARE;
      const taken = allocated(() =>
        attempt(() => {
          const groups = readPage(header, page, bytes);
          dag.add(
            page,
            groups.map(({ info }) => info),
          );
          for (const group of groups) packGroup(group, dag);
        }),
      );
      if (taken > most) throw new Error(`page ${page} took ${taken} bytes, not ${most} at most`);
    });
  for (let mesh = 0; mesh < header.meshes.length; ++mesh)
    for (const view of [cameraView([0, 0, 2], 1, 500, 1), { kind: "error", error: 0 } as const])
      dag.traverse(mesh, view, () => true);
}

function makeMaterials(header: FileHeader): void {
  const { materials, textures, samplers, images } = header.materials;
  listOf(textures);
  listOf(samplers);
  for (const gltf of listOf(materials)) {
    makeMaterial(gltf, LAYOUT, () => {});
    for (const slot of [...STANDARD, ...PHYSICAL]) {
      const info = jsonOf(textureInfo(gltf, slot));
      channelOf(info);
      repeatsOf(info);
    }
  }
  for (const row of listOf(images)) {
    const image = new StreamedImage(row);
    if (!image.isBroken) image.levelFor(300);
  }
}

/** Streams until no updates come; an error other than an UmbelError ends the test. */
async function stream(file: Uint8Array): Promise<void> {
  const source = new BlobSource(new Blob([file as Uint8Array<ArrayBuffer>]));
  let updates = 0;
  const listener = { update: () => void ++updates, connection: () => {}, failed: () => {} };
  let streamer: Streamer;
  try {
    streamer = await Streamer.open(source, { budget: 1 << 19 }, listener);
  } catch (error) {
    if (!(error instanceof UmbelError)) throw error;
    return;
  }
  const views = streamer.info.instances.map(({ mesh }) => ({
    mesh,
    view: cameraView([0.3, 0.2, 1.5], 1, 800, 0.5),
  }));
  streamer.setViews(views.slice(0, 8));
  // Each turn may step once; one that never rests would step in every turn.
  let rests = 0;
  for (let turn = 0; turn < 300 && rests < 5; ++turn) {
    const before = updates;
    await new Promise((next) => setTimeout(next, 0));
    rests = updates === before ? rests + 1 : 0;
  }
  streamer.close();
  if (rests < 5) throw new Error("the stream never rests");
}

/**
 * Reads a file as far as that works; throws if it fails with anything but an UmbelError.
 * @param streams whether it is streamed too, which takes most of the time
 */
export async function show(file: Uint8Array, streams = true): Promise<void> {
  const start = performance.now();
  let header: FileHeader | undefined;
  const taken = allocated(() =>
    attempt(() => {
      header = readFileHeader(file);
    }),
  );
  if (taken > HEADER_FACTOR * file.length + SPARE)
    throw new Error(`the file header took ${taken} bytes`);
  if (header) {
    readPages(file, header);
    makeMaterials(header);
  }
  if (streams) await stream(file);
  const time = performance.now() - start;
  if (time > MOST_TIME) throw new Error(`it took ${Math.round(time)} ms`);
}
