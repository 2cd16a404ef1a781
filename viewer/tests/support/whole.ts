// All of an asset at once: every group known, and the cuts that come of it.

import { type GroupInfo, readPage } from "../../packages/umbel/src/decode/page.js";
import { type Head, NONE, readHead } from "../../packages/umbel/src/format/file_header.js";
import { Catalog } from "../../packages/umbel/src/select/catalog.js";
import { cameraView, type View } from "../../packages/umbel/src/select/select.js";
import { assetBytes, type SaidView } from "./assets.js";

export interface Whole {
  file: Uint8Array;
  head: Head;
  catalog: Catalog;
}

export function whole(name: string): Whole {
  const file = assetBytes(name);
  const head = readHead(file);
  const catalog = new Catalog(head);
  const { offset, size, count } = head.pages;
  for (let page = 0; page < count; ++page) {
    const bytes = file.subarray(offset[page], offset[page] + size[page]);
    catalog.add(
      page,
      readPage(head, page, bytes).map(({ info }) => info),
    );
  }
  return { file, head, catalog };
}

export function viewOf(from: SaidView): View {
  if (from.kind === "error") return { kind: "error", error: from.error };
  if (from.kind === "level") return { kind: "level", level: from.level };
  return cameraView(from.eye, from.fov_y, from.height, from.pixel_error);
}

/** The groups that a view refines. */
export function targetOf({ catalog }: Whole, view: View): Uint8Array {
  const target = new Uint8Array(catalog.count);
  catalog.walk(0, view, (group) => {
    target[group] = 1;
    return true;
  });
  return target;
}

/** The clusters that are drawn when exactly these groups are refined. */
export function drawnClusters({ catalog }: Whole, refined: Uint8Array): number[] {
  const drawn: number[] = [];
  for (let g = 0; g < catalog.count; ++g) {
    if (!refined[g]) continue;
    const info = catalog.info[g] as GroupInfo;
    info.generating.forEach((generating, i) => {
      if (generating === NONE || !refined[generating]) drawn.push(info.firstCluster + i);
    });
  }
  return drawn.sort((a, b) => a - b);
}

export function select(asset: Whole, view: View): number[] {
  return asset.head.groups ? drawnClusters(asset, targetOf(asset, view)) : [];
}
