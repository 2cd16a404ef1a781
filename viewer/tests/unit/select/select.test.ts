import { readFileSync } from "node:fs";
import { join } from "node:path";
import { describe, expect, test } from "vitest";
import {
  cameraView,
  isBackfacing,
  isBoxOutside,
  isSphereOutside,
  mustRefine,
  type View,
} from "../../../packages/umbel/src/select/select.js";
import { assetNames, expectedOf, ROOT, words } from "../../support/assets.js";
import { drawnClusters, loadAsset, select, viewOf } from "../../support/loaded_asset.js";

describe.each(assetNames())("%s", (name) => {
  const asset = loadAsset(name);

  test("gives the library's cut, by traversal and group by group", () => {
    const { dag } = asset;
    for (const each of expectedOf(name).views) {
      const view = viewOf(each);
      const wanted = [...words(each.cut)];
      expect(select(asset, view)).toEqual(wanted);
      const refined = Uint8Array.from({ length: dag.count }, (_, g) =>
        Number(dag.mustRefine(g, view)),
      );
      expect(drawnClusters(asset, refined)).toEqual(wanted);
    }
  });
});

test("the cut without error has all triangles of the source", () => {
  const asset = loadAsset("planet");
  const triangles = words(expectedOf("planet").triangles);
  const cut = select(asset, { kind: "level", level: 0 });
  const sum = cut.reduce((all, c) => all + triangles[c], 0);
  expect(sum).toBe(asset.header.meshes[0].sourceTriangles);
});

interface Vectors {
  tables: Record<string, { groups: number[][]; clusters: number[][]; facing: number[][] }>;
  cuts: { tables: string; view: View; planes: number[][]; facing: boolean; cut: number[] }[];
  cameras: {
    eye: [number, number, number];
    fov_y: number;
    height: number;
    pixel_error: number;
    threshold: number;
  }[];
}

describe("the library's test vectors", () => {
  const path = join(ROOT, "tests/vectors/selection.json");
  const vectors = JSON.parse(readFileSync(path, "utf-8")) as Vectors;
  const float = (x: number | null) => (x === null ? Infinity : Math.fround(x));

  /** The cut by the definition of docs/selection.md: every group and cluster by itself. */
  function cutOf({ tables, view, planes, facing }: Vectors["cuts"][number]): number[] {
    const { groups, clusters, facing: cones } = vectors.tables[tables];
    const spheres = Float32Array.from(groups.flatMap((row) => row.slice(4, 8)));
    const sides = Float32Array.from(planes.flat());
    const eye = view.kind === "camera" ? view.eye.map(Math.fround) : [];
    if (view.kind === "camera") view.eye = [eye[0], eye[1], eye[2]];
    const refined = groups.map((row, g) => mustRefine(spheres, g, float(row[8]), row[2], view));
    return clusters.flatMap(([group, generating, , , , ...box], c) => {
      if (!refined[group] || refined[generating]) return [];
      if (isSphereOutside(sides, spheres, group)) return [];
      if (isBoxOutside(sides, Float32Array.from(box))) return [];
      const [x, y, z, radius, , , , ax, ay, az, cutoff] = (cones[c] ?? []).map(Math.fround);
      const isAway =
        facing && isBackfacing({ sphere: [x, y, z, radius], axis: [ax, ay, az], cutoff }, eye);
      return isAway ? [] : [c];
    });
  }

  test("give the same cuts", () => {
    expect(vectors.cuts.length).toBeGreaterThan(20);
    for (const each of vectors.cuts) expect(cutOf(each)).toEqual(each.cut);
  });

  test("give the same thresholds", () => {
    for (const { eye, fov_y, height, pixel_error, threshold } of vectors.cameras) {
      const mine = cameraView(eye, fov_y, height, pixel_error).threshold;
      expect(Math.abs(mine / threshold - 1)).toBeLessThan(1e-6);
    }
  });
});
