import { describe, expect, test } from "vitest";
import {
  cameraView,
  drawnClusters,
  mustRefine,
  select,
  type View,
} from "../../packages/umbel/src/select.js";
import { readTables } from "../../packages/umbel/src/tables.js";
import { assetBytes, assetNames, type SaidView, said, words } from "../assets.js";

function viewOf(from: SaidView): View {
  if (from.kind === "error") return { kind: "error", error: from.error };
  if (from.kind === "level") return { kind: "level", level: from.level };
  return cameraView(from.eye, from.fov_y, from.height, from.pixel_error);
}

describe.each(assetNames())("%s", (name) => {
  const tables = readTables(assetBytes(name));

  test("is cut as the library cuts it, through the hierarchy and without", () => {
    const { views } = said(name);
    for (const each of views) {
      const view = viewOf(each);
      const wanted = [...words(each.cut)];
      expect(select(tables, view)).toEqual(wanted);
      const refined = Uint8Array.from({ length: tables.groups.count }, (_, g) =>
        Number(mustRefine(tables, g, view)),
      );
      expect(drawnClusters(tables, refined)).toEqual(wanted);
    }
  });
});

test("the cut of no error is level 0, triangle by triangle", () => {
  const tables = readTables(assetBytes("planet"));
  const { clusters, header } = tables;
  const cut = select(tables, { kind: "level", level: 0 });
  expect(cut.reduce((sum, c) => sum + clusters.triangles[c], 0)).toBe(header.sourceTriangles);
});
