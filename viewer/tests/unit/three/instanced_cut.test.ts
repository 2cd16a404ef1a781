import {
  Box3,
  BufferGeometry,
  Float32BufferAttribute,
  Matrix4,
  MeshBasicMaterial,
  Object3D,
  Vector3,
} from "three";
import { expect, test } from "vitest";
import type { InstanceRow } from "../../../packages/umbel/src/stream/instance_rows.js";
import { Batch } from "../../../packages/umbel/src/three/geometry/batch.js";
import { InstancedCut } from "../../../packages/umbel/src/three/instanced_cut.js";
import type { Materials } from "../../../packages/umbel/src/three/materials/materials.js";
import { MeshInstance } from "../../../packages/umbel/src/three/mesh_instance.js";

/** A batch of some vertices, and of room for more. */
function batch(): Batch {
  const positions = new Float32BufferAttribute([1, 2, 3, ...Array(90).fill(0)], 3);
  const geometry = new BufferGeometry().setAttribute("position", positions);
  return new Batch(geometry, new MeshBasicMaterial());
}

class Cut extends InstancedCut {
  newBatch(): Batch {
    return this.add(batch());
  }
}

class Single extends MeshInstance {
  newBatch(): Batch {
    return this.add(batch());
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
  const cut = new Cut(rowOf(placements), 0, new Object3D(), {} as Materials, new Box3());
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

test.each([false, true])("boxes of three.js contain all placements; precise: %s", (isPrecise) => {
  const bounds = new Box3(new Vector3(4, 5, 6), new Vector3(7, 9, 11));
  for (const placements of [[TURN], [MIRRORED]]) {
    const parent = new Object3D();
    parent.position.set(100, 0, 0);
    parent.updateMatrixWorld();
    new Cut(rowOf(placements), 0, parent, {} as Materials, bounds).newBatch();
    const box = new Box3().setFromObject(parent, isPrecise);
    expect(box.min.toArray()).toEqual([104, 5, 6]);
    expect(box.max.toArray()).toEqual([107, 9, 11]);
  }
});

test.each([false, true])("so do those of a single mesh; precise: %s", (isPrecise) => {
  const bounds = new Box3(new Vector3(4, 5, 6), new Vector3(7, 9, 11));
  const instance = { mesh: 0, matrix: Float32Array.of(1, 0, 0, 10, 0, 1, 0, 0, 0, 0, 1, 0) };
  const parent = new Object3D();
  new Single(instance, 0, parent, {} as Materials, bounds).newBatch();
  const box = new Box3().setFromObject(parent, isPrecise);
  expect(box.min.toArray()).toEqual([14, 5, 6]);
  expect(box.max.toArray()).toEqual([17, 9, 11]);
});
