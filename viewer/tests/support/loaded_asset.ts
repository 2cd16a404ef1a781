// A whole asset: all groups known, and the cuts of its DAG.

import type { GroupInfo } from "../../packages/umbel/src/decode/group.js";
import { readPage } from "../../packages/umbel/src/decode/page.js";
import {
  type FileHeader,
  NONE,
  readFileHeader,
} from "../../packages/umbel/src/format/file_header.js";
import { GroupDag } from "../../packages/umbel/src/select/group_dag.js";
import { cameraView, type View } from "../../packages/umbel/src/select/select.js";
import { assetBytes, type ExpectedView } from "./assets.js";

export interface LoadedAsset {
  file: Uint8Array;
  header: FileHeader;
  dag: GroupDag;
}

export function loadAsset(name: string): LoadedAsset {
  const file = assetBytes(name);
  const header = readFileHeader(file);
  const dag = new GroupDag(header);
  const { offset, size, count } = header.pages;
  for (let page = 0; page < count; ++page) {
    const bytes = file.subarray(offset[page], offset[page] + size[page]);
    dag.add(
      page,
      readPage(header, page, bytes).map(({ info }) => info),
    );
  }
  return { file, header, dag };
}

export function viewOf(from: ExpectedView): View {
  if (from.kind === "error") return { kind: "error", error: from.error };
  if (from.kind === "level") return { kind: "level", level: from.level };
  return cameraView(from.eye, from.fov_y, from.height, from.pixel_error);
}

/** The groups that a view refines, by their slots. */
export function targetOf({ dag }: LoadedAsset, view: View): Uint8Array {
  const target = new Uint8Array(dag.count);
  dag.traverse(0, view, (group) => {
    target[group] = 1;
    return true;
  });
  return target;
}

/** The clusters that are drawn when exactly the groups in these slots are refined. */
export function drawnClusters({ dag }: LoadedAsset, refined: Uint8Array): number[] {
  const drawn: number[] = [];
  for (let g = 0; g < dag.count; ++g) {
    if (!refined[g]) continue;
    const info = dag.info[g] as GroupInfo;
    dag.generating[g].forEach((generating, i) => {
      if (generating === NONE || !refined[generating]) drawn.push(info.firstCluster + i);
    });
  }
  return drawn.sort((a, b) => a - b);
}

export function select(asset: LoadedAsset, view: View): number[] {
  return asset.header.groups ? drawnClusters(asset, targetOf(asset, view)) : [];
}
