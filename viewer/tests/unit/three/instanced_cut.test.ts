import { BufferGeometry, Matrix4, MeshBasicMaterial, Object3D } from "three";
import { expect, test } from "vitest";
import type { InstanceRow } from "../../../packages/umbel/src/stream/instance_rows.js";
import { Batch } from "../../../packages/umbel/src/three/geometry/batch.js";
import { InstancedCut } from "../../../packages/umbel/src/three/instanced_cut.js";
import type { Materials } from "../../../packages/umbel/src/three/materials/materials.js";

class Cut extends InstancedCut {
  newBatch(): Batch {
    return this.add(new Batch(new BufferGeometry(), new MeshBasicMaterial()));
  }
}

function rowOf(placements: readonly Matrix4[]): InstanceRow {
  const matrices = Float32Array.from(placements.flatMap(({ elements }) => elements));
  return { key: "", mesh: 0, matrices, count: placements.length, isOwn: false, nearest: 0 };
}

const TURN = new Matrix4().makeRotationY(0.5).setPosition(1, 2, 3);
const MIRRORED = new Matrix4().makeScale(2, -1, 1).premultiply(TURN);

test.each([
  ["placements", [TURN, TURN.clone().setPosition(4, 5, 6)]],
  ["placements that mirror", [MIRRORED, MIRRORED.clone().setPosition(4, 5, 6)]],
])("%s have the right place and side", (_, placements) => {
  const cut = new Cut(rowOf(placements), 0, new Object3D(), {} as Materials);
  const check = (shown: readonly Matrix4[]) => {
    const batch = cut.newBatch();
    expect(batch.instances?.count).toBe(shown.length);
    shown.forEach((placement, i) => {
      const instance = new Matrix4().fromArray(batch.instances?.attribute.array ?? [], 16 * i);
      const world = instance.premultiply(batch.matrixWorld).elements;
      world.forEach((x, j) => {
        expect(x).toBeCloseTo(placement.elements[j], 5);
      });
    });
    // three.js turns the front of triangles by the sign of this.
    expect(Math.sign(batch.matrixWorld.determinant())).toBe(Math.sign(shown[0].determinant()));
    expect(cut.matrix.elements[12]).toBeCloseTo(shown[0].elements[12], 5);
  };
  check(placements);
  const fewer = placements.slice(1);
  cut.setRow(rowOf(fewer));
  check(fewer);
  const more = [...placements, ...placements, ...placements];
  cut.setRow(rowOf(more));
  check(more);
});
