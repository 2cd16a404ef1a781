import { readFileSync } from "node:fs";
import { join } from "node:path";
import { Matrix4 } from "three";
import { describe, expect, test } from "vitest";
import { type FileHeader, readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import {
  type InstanceTables,
  ROWS,
  readInstanceNodes,
  readPlacements,
} from "../../../packages/umbel/src/format/instance_tree.js";
import { InstanceSelector } from "../../../packages/umbel/src/select/instance_selector.js";
import { cameraView } from "../../../packages/umbel/src/select/select.js";
import { instanceRows } from "../../../packages/umbel/src/stream/instance_rows.js";
import { ASSETS, assetBytes } from "../../support/assets.js";
import { kindOf } from "../../support/error_kind.js";

interface Expected {
  eye: [number, number, number];
  fov_y: number;
  height: number;
  pixel_error: number;
  planes: number[];
  missing: number[];
  /** Node, first placement, count, and 1 if the coarsest clusters suffice. */
  runs: number[];
  shown: number;
  stand_ins: number;
}

const FILE = assetBytes("forest");
const HEADER = readFileHeader(FILE) as FileHeader & { tree: InstanceTables };
const STEPS = JSON.parse(readFileSync(join(ASSETS, "forest.steps.json"), "utf-8")) as Expected[];
const { offset: NODES, count: COUNT, stride: STRIDE } = HEADER.tree.nodes;
const nodeBytes = (file = FILE) => file.subarray(NODES, NODES + COUNT * STRIDE);
const readNodes = (file = FILE) =>
  readInstanceNodes(nodeBytes(file), HEADER.tree, HEADER.instances.length);

function makeSelector(maxBytes: number): InstanceSelector {
  const meshes = HEADER.meshes.map(({ low, high }, mesh) => ({
    low,
    high,
    coarsestError: HEADER.tree.coarsestErrors[mesh],
  }));
  return new InstanceSelector(readNodes(), meshes, HEADER.instances, maxBytes);
}

function load(selector: InstanceSelector, node: number): void {
  const { offset, size } = selector.nodes;
  const bytes = FILE.subarray(offset[node], offset[node] + size[node]);
  selector.add(node, readPlacements(bytes, selector.nodes, node, HEADER.meshes.length));
}

function viewOf({ eye, fov_y, height, pixel_error }: Expected) {
  return cameraView(eye, fov_y, height, pixel_error);
}

function settle(selector: InstanceSelector, expected: Expected) {
  for (;;) {
    const step = selector.step(viewOf(expected), Float32Array.from(expected.planes));
    if (!step) throw new Error("a step without a limit is always whole");
    if (step.missing.length === 0) return step;
    for (const node of step.missing) load(selector, node);
    selector.evict();
  }
}

describe("steps are the library's", () => {
  test.each(STEPS.map((step, i) => [i, step] as const))("of view %i", (_, expected) => {
    const selector = makeSelector(2 ** 30);
    const first = selector.step(viewOf(expected), Float32Array.from(expected.planes));
    expect(first?.missing).toEqual(expected.missing);
    const last = settle(selector, expected);
    const runs = last.runs.flatMap(({ node, first, count, isCoarsest }) => [
      node,
      first,
      count,
      Number(isCoarsest),
    ]);
    expect(runs).toEqual(expected.runs);
    expect([last.shown, last.standIns]).toEqual([expected.shown, expected.stand_ins]);
  });
});

test("pages that are not needed go, and what is shown stays the same", () => {
  const small = makeSelector(0);
  for (const expected of [...STEPS, ...STEPS]) {
    expect(settle(small, expected).shown).toBe(expected.shown);
    small.step(viewOf(expected), Float32Array.from(expected.planes));
    small.evict();
  }
  const last = STEPS[STEPS.length - 1];
  const fresh = makeSelector(0);
  settle(fresh, last);
  expect(small.bytes).toBe(fresh.bytes);
});

test("a step that would show too much gives up", () => {
  const selector = makeSelector(2 ** 30);
  settle(selector, STEPS[0]);
  const planes = Float32Array.from(STEPS[0].planes);
  expect(selector.step(viewOf(STEPS[0]), planes, STEPS[0].shown - 1)).toBeUndefined();
  expect(selector.step(viewOf(STEPS[0]), planes, STEPS[0].shown)?.shown).toBe(STEPS[0].shown);
});

describe("rows", () => {
  const selector = makeSelector(2 ** 30);
  const step = settle(selector, STEPS[0]);
  const view = viewOf(STEPS[0]);
  const { coarsestErrors } = HEADER.tree;
  const found = instanceRows(step, (n) => selector.page(n), selector.nodes, coarsestErrors, view);

  test("have every placement once, and few views", () => {
    expect(found.rows.reduce((sum, { count }) => sum + count, 0)).toBe(step.shown);
    for (const { matrices, count } of found.rows) expect(matrices.length).toBe(16 * count);
    expect(new Set(found.rows.map(({ key }) => key)).size).toBe(found.rows.length);
    expect(found.rows.length).toBeGreaterThan(8);
    expect(found.rows.length).toBeLessThan(100);
    expect(found.views.map(({ key }) => key)).toEqual(found.rows.map(({ key }) => key));
  });

  test("have errors that the view allows for each of their placements", () => {
    let checked = 0;
    found.rows.forEach(({ matrices, count, mesh, isOwn }, k) => {
      const own = found.views[k].view;
      if (isOwn || own.kind !== "error" || own.error > 1e30) return;
      const { low, high } = HEADER.meshes[mesh];
      const radius = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) / 2;
      for (let i = 0; i < count; ++i) {
        const m = matrices.subarray(16 * i, 16 * i + 16);
        const most = Math.max(...[0, 4, 8].map((c) => Math.hypot(m[c], m[c + 1], m[c + 2])));
        const distance = Math.hypot(...[0, 1, 2].map((j) => m[12 + j] - view.eye[j]));
        expect(own.error * most).toBeLessThanOrEqual(
          view.threshold * (distance + most * radius) + 1e-6,
        );
        ++checked;
      }
    });
    expect(checked).toBeGreaterThan(100);
  });

  test("have placements that all mirror their mesh, or none", () => {
    const mirrored = (node: number) => {
      const page = selector.page(node);
      // Every second one.
      const rows = page.rows.map((x, i) => (i % 4 === 0 && (i / ROWS) & 1 ? -x : x));
      return { ...page, rows };
    };
    const both = instanceRows(step, mirrored, selector.nodes, coarsestErrors, view);
    const signs = both.rows.map(({ matrices, count }) =>
      Array.from({ length: count }, (_, i) =>
        Math.sign(new Matrix4().fromArray(matrices, 16 * i).determinant()),
      ),
    );
    for (const row of signs) expect(new Set(row).size).toBe(1);
    expect(new Set(signs.flat())).toEqual(new Set([1, -1]));
    expect(both.rows.reduce((sum, { count }) => sum + count, 0)).toBe(step.shown);
  });

  test("are the same for the same step, and differ for another", () => {
    const again = instanceRows(step, (n) => selector.page(n), selector.nodes, coarsestErrors, view);
    expect(again.hash).toBe(found.hash);
    const far = cameraView([400, 3.5, 400], 0.8, 600, 2);
    const other = instanceRows(step, (n) => selector.page(n), selector.nodes, coarsestErrors, far);
    expect(other.hash).not.toBe(found.hash);
  });
});

test("damaged nodes and pages are refused", () => {
  const bad = FILE.slice();
  bad[NODES + 70] ^= 1;
  expect(kindOf(() => readNodes(bad))).toBe("corrupt");
  const nodes = readNodes();
  const page = FILE.slice(nodes.offset[1], nodes.offset[1] + nodes.size[1]);
  page[40] ^= 1;
  expect(kindOf(() => readPlacements(page, nodes, 1, 3))).toBe("corrupt");
});
