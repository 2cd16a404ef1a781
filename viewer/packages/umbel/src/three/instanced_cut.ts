// Many instances that share a cut: drawn by one call for each range.

import {
  type Box3,
  type Frustum,
  InstancedBufferAttribute,
  type Material,
  Matrix4,
  type Object3D,
} from "three";
import type { InstanceRow } from "../stream/instance_rows.js";
import {
  type Batch,
  type InstanceMatrices,
  type LineBatch,
  setBounds,
  setInstances,
} from "./geometry/batch.js";
import type { ResidentGroup } from "./geometry/resident_groups.js";
import type { Materials } from "./materials/materials.js";
import { type DrawCounts, MeshInstance } from "./mesh_instance.js";

const FLOATS = 16;
const IDENTITY = new Matrix4();
/** Its own inverse. */
const MIRROR = new Matrix4().makeScale(-1, 1, 1);

/** Its `matrix` is that of the nearest instance, which textures and clicks go by. */
export class InstancedCut extends MeshInstance {
  private instances: InstanceMatrices = instancesOf(new Float32Array(0), 0);
  /** Of the batches: three.js takes from it which side of a triangle is in front. */
  private batchMatrix = IDENTITY;

  /** @param bounds contains all instances, in the parent's space */
  constructor(
    row: InstanceRow,
    number: number,
    parent: Object3D,
    materials: Materials,
    bounds: Box3,
  ) {
    super({ mesh: row.mesh, matrix: new Float32Array(12) }, number, parent, materials, bounds);
    this.setRow(row);
  }

  /** Replaces the instances. */
  setRow(row: InstanceRow): void {
    this.matrix = new Matrix4().fromArray(row.matrices, FLOATS * row.nearest);
    if (this.matrix.determinant() < 0) {
      this.batchMatrix = MIRROR;
      mirror(row.matrices);
    }
    const { attribute } = this.instances;
    if (FLOATS * row.count <= attribute.array.length) {
      attribute.array.set(row.matrices);
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, FLOATS * row.count);
      attribute.needsUpdate = true;
      this.instances.count = row.count;
    } else {
      this.free();
      this.instances = instancesOf(row.matrices, row.count);
    }
    for (const batch of this.all()) setInstances(batch, this.instances);
  }

  override updateRanges(
    frustum: Frustum,
    lineMaterial: Material | undefined,
    drawn: DrawCounts,
  ): void {
    const one: DrawCounts = { calls: 0, triangles: 0, clusters: 0 };
    super.updateRanges(frustum, lineMaterial, one);
    drawn.calls += one.calls;
    drawn.triangles += one.triangles * this.instances.count;
    drawn.clusters += one.clusters * this.instances.count;
  }

  /** The tree of instances has left out what is not visible. */
  protected override visibleRuns(
    _frustum: Frustum,
    visit: (resident: ResidentGroup, first: number, count: number) => void,
  ): void {
    this.runs(visit);
  }

  protected override add<T extends Batch | LineBatch>(object: T): T {
    setInstances(object, this.instances);
    setBounds(object, this.bounds.clone().applyMatrix4(this.batchMatrix));
    object.matrix.copy(this.batchMatrix);
    this.parent.add(object);
    object.updateMatrixWorld(true);
    return object;
  }

  override dispose(): void {
    this.free();
    super.dispose();
  }

  /** Frees the matrices on the GPU. */
  private free(): void {
    for (const batch of this.all())
      (batch as unknown as Disposable).dispatchEvent({ type: "dispose" });
  }
}

interface Disposable {
  dispatchEvent(event: { type: "dispose" }): void;
}

/** Mirrors what matrices of instances transform to. */
function mirror(matrices: Float32Array): void {
  for (let i = 0; i < matrices.length; i += 4) matrices[i] = -matrices[i];
}

/** With room for more, so that few changes need other memory. */
function instancesOf(matrices: Float32Array, count: number): InstanceMatrices {
  const room = new Float32Array(FLOATS * Math.ceil(1.5 * count));
  room.set(matrices);
  return { attribute: new InstancedBufferAttribute(room, FLOATS), count };
}
