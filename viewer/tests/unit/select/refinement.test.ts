import { expect, test } from "vitest";
import {
  isDrawn,
  keepDrawable,
  nextRefinement,
} from "../../../packages/umbel/src/select/refinement.js";
import { cameraView, type View } from "../../../packages/umbel/src/select/select.js";
import { drawnClusters, loadAsset, targetOf } from "../../support/loaded_asset.js";
import { Random } from "../../support/random.js";

const PLANET = loadAsset("planet");
const { dag: DAG } = PLANET;
const NEAR = [0, 0, 1.3] as const;

const target = (view: View) => targetOf(PLANET, view);

/** Expects the parents of every group of a set in the set. */
function expectClosed(refined: Uint8Array): void {
  for (let g = 0; g < DAG.count; ++g)
    if (refined[g]) for (const parent of DAG.coarser[g]) expect(refined[parent]).toBe(1);
}

test("with all pages resident, the selected cut is drawn", () => {
  const all = new Uint8Array(DAG.count).fill(1);
  const selected = target(cameraView(NEAR, 0.8, 800, 4));
  const before = target(cameraView([0, 3, 0], 0.8, 800, 1));
  expect(nextRefinement(DAG, selected, before, all)).toEqual(selected);
});

test("with any pages resident, a whole surface is drawn from resident pages only", () => {
  const random = new Random(5);
  let before = new Uint8Array(DAG.count);
  for (let round = 0; round < 60; ++round) {
    const share = random.unit();
    const isResident = Uint8Array.from({ length: DAG.count }, (_, g) =>
      // Roots and drawn groups stay resident, as Residency guarantees.
      Number(
        DAG.error[g] === Infinity ||
          random.unit() < share ||
          (before[g] !== 0 && isDrawn(DAG, before, g)),
      ),
    );
    const [x, y, z] = [random.unit(), random.unit(), random.unit()];
    const view = cameraView([4 * x - 2, 4 * y - 2, 4 * z - 2], 0.8, 800, 1 + 8 * random.unit());
    const refined = nextRefinement(DAG, target(view), before, isResident);
    expectClosed(refined);
    for (let g = 0; g < DAG.count; ++g)
      if (refined[g] && isDrawn(DAG, refined, g)) expect(isResident[g]).toBe(1);
    expect(drawnClusters(PLANET, refined).length).toBeGreaterThan(0);
    before = new Uint8Array(refined);
  }
});

test("groups that are refined all over need not be resident", () => {
  const finest = target({ kind: "error", error: 0 });
  const isResident = Uint8Array.from({ length: DAG.count }, (_, g) =>
    Number(isDrawn(DAG, finest, g)),
  );
  const refined = finest.slice();
  keepDrawable(DAG, refined, isResident);
  expect(refined).toEqual(finest);
  expect(isResident.filter((is) => !is).length).toBeGreaterThan(10);
});
