// What a viewer does with a file, without a browser: reads its head and pages, chooses, streams,
// packs for the GPU and makes materials; and what may come of it: the right thing, or an UmbelError.

import { readPage } from "../../packages/umbel/src/decode/page.js";
import { UmbelError } from "../../packages/umbel/src/errors.js";
import { type FileHeader, readFileHeader } from "../../packages/umbel/src/format/file_header.js";
import { jsonOf, listOf } from "../../packages/umbel/src/format/gltf.js";
import { GroupDag } from "../../packages/umbel/src/select/group_dag.js";
import { cameraView } from "../../packages/umbel/src/select/select.js";
import { packGroup } from "../../packages/umbel/src/stream/render_group.js";
import { BlobSource } from "../../packages/umbel/src/stream/source.js";
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

/** Of all that is made of a page, for each number that its clusters state; and of the head. */
const WORDS_EACH = 8;
const HEAD_FACTOR = 64;
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

/** Numbers that the clusters of a page state that they have. */
function statedNumbers(head: FileHeader, page: number, bytes: Uint8Array): number {
  const { maxVertices, maxTriangles } = head.fixed;
  const components = Math.max(...head.meshes.map(({ smooth }) => smooth.length), 1);
  const clusters = Math.min(bytes.length / 24, head.clusters + head.pages.groups[page]);
  return (
    clusters *
    (Math.min(maxVertices, 256) * (components + 8) + 3 * Math.min(maxTriangles, 256) + 40)
  );
}

function readPages(file: Uint8Array, head: FileHeader): void {
  const dag = new GroupDag(head);
  for (let page = 0; page < head.pages.count; ++page)
    attempt(() => {
      const { offset, size } = head.pages;
      const bytes = file.subarray(offset[page], offset[page] + size[page]);
      const most = 4 * WORDS_EACH * statedNumbers(head, page, bytes) + 4 * bytes.length + SPARE;
      const taken = allocated(() =>
        attempt(() => {
          const groups = readPage(head, page, bytes);
          dag.add(
            page,
            groups.map(({ info }) => info),
          );
          for (const group of groups) packGroup(group, dag);
        }),
      );
      if (taken > most) throw new Error(`page ${page} took ${taken} bytes, not ${most} at most`);
    });
  for (let mesh = 0; mesh < head.meshes.length; ++mesh)
    for (const view of [cameraView([0, 0, 2], 1, 500, 1), { kind: "error", error: 0 } as const])
      dag.traverse(mesh, view, () => true);
}

function makeMaterials(head: FileHeader): void {
  const { materials, textures, samplers, images } = head.materials;
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

/** Streams until nothing moves any more; an error that it does not say ends the test. */
async function stream(file: Uint8Array): Promise<void> {
  const source = new BlobSource(new Blob([file as Uint8Array<ArrayBuffer>]));
  let updates = 0;
  const listener = { update: () => void ++updates, connection: () => {} };
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
 * Shows a file as far as it can be shown; throws if anything but an UmbelError comes of it.
 * @param streams whether it is streamed too, which takes most of the time
 */
export async function show(file: Uint8Array, streams = true): Promise<void> {
  const start = performance.now();
  let head: FileHeader | undefined;
  const taken = allocated(() =>
    attempt(() => {
      head = readFileHeader(file);
    }),
  );
  if (taken > HEAD_FACTOR * file.length + SPARE) throw new Error(`the head took ${taken} bytes`);
  if (head) {
    readPages(file, head);
    makeMaterials(head);
  }
  if (streams) await stream(file);
  const time = performance.now() - start;
  if (time > MOST_TIME) throw new Error(`it took ${Math.round(time)} ms`);
}
