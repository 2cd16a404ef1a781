// An instance of a mesh in the object: it lists the ranges to draw, by arena and material.

import { type Box3, type Frustum, type Material, Matrix4, type Object3D } from "three";
import type { Instance as InstanceRow } from "../format/tables.js";
import { matrixOf } from "./camera_view.js";
import { boxOf, type ClusterInfo, clusterInfo } from "./cluster_info.js";
import type { Arena } from "./geometry/arena.js";
import { Batch, LineBatch, setBounds } from "./geometry/batch.js";
import type { ResidentGroup } from "./geometry/resident_groups.js";
import type { Materials } from "./materials/materials.js";

/** Counts of a frame. */
export interface DrawCounts {
  calls: number;
  triangles: number;
  clusters: number;
}

export class MeshInstance {
  readonly mesh: number;
  /** From the mesh to the object. */
  matrix: Matrix4;
  /** Runs of clusters; see StreamUpdate.cuts. */
  private cut = new Uint32Array(0);
  /** The group of each run. */
  private groups: ResidentGroup[] = [];
  /** By arena, then by material. */
  private readonly batches = new Map<Arena, Map<number, Batch>>();
  private readonly lines = new Map<Arena, LineBatch>();

  constructor(
    { mesh, matrix }: InstanceRow,
    readonly number: number,
    protected readonly parent: Object3D,
    private readonly materials: Materials,
    /** Contains the mesh. */
    protected readonly bounds: Box3,
  ) {
    this.mesh = mesh;
    this.matrix = matrixOf(matrix);
  }

  setCut(cut: Uint32Array, groupOf: Map<number, ResidentGroup>): void {
    this.cut = cut as Uint32Array<ArrayBuffer>;
    this.groups = [];
    for (let run = 0; run < cut.length; run += 3)
      this.groups.push(groupOf.get(cut[run]) as ResidentGroup);
  }

  /** The clusters of the cut, culled ones included. */
  *clusters(): Generator<ClusterInfo> {
    const { cut, groups, matrix, number } = this;
    for (let i = 0; i < groups.length; ++i) {
      const first = cut[3 * i];
      for (let c = first; c < first + cut[3 * i + 1]; ++c) {
        const info = clusterInfo((groups[i] as ResidentGroup).group, c, cut[3 * i + 2] === 1);
        yield { ...info, instance: number, matrix };
      }
    }
  }

  /** Expands a box of the object by the clusters of the cut, culled ones included. */
  expand(box: Box3): void {
    this.runs(({ group }, first, count) => {
      const begin = first - group.firstCluster;
      for (let i = begin; i < begin + count; ++i)
        box.union(boxOf(group, i).applyMatrix4(this.matrix));
    });
  }

  worldMatrix(): Matrix4 {
    return new Matrix4().multiplyMatrices(this.parent.matrixWorld, this.matrix);
  }

  /** Lists the ranges of visible clusters for the GPU, and adds them to `drawn`. */
  updateRanges(frustum: Frustum, lineMaterial: Material | undefined, drawn: DrawCounts): void {
    for (const batch of this.all()) batch.ranges.clear();
    const visit = (resident: ResidentGroup, first: number, count: number) => {
      this.addRun(resident, first, count, drawn);
      if (lineMaterial) this.addLines(resident, first, count, lineMaterial);
    };
    const { castShadow, receiveShadow, renderOrder, frustumCulled } = this.parent;
    // Shadows of what is outside of the picture may fall into it.
    if (frustumCulled && !castShadow) this.visibleRuns(frustum, visit);
    else this.runs(visit);
    for (const batch of this.all()) {
      batch.visible = batch.ranges.length > 0;
      if (batch.visible) ++drawn.calls;
      batch.layers.mask = this.parent.layers.mask;
      Object.assign(batch, { castShadow, receiveShadow, renderOrder });
    }
  }

  protected *all(): Generator<Batch | LineBatch> {
    for (const batches of this.batches.values()) yield* batches.values();
    yield* this.lines.values();
  }

  /** The visible groups, each once. */
  visibleGroups(frustum: Frustum): Set<ResidentGroup> {
    const found = new Set<ResidentGroup>();
    this.visibleRuns(frustum, (resident) => found.add(resident));
    return found;
  }

  /** Takes all objects out of the scene. */
  dispose(): void {
    for (const batch of this.all()) this.parent.remove(batch);
    this.batches.clear();
    this.lines.clear();
  }

  protected visibleRuns(
    frustum: Frustum,
    visit: (resident: ResidentGroup, first: number, count: number) => void,
  ): void {
    const isVisible = new Map<ResidentGroup, boolean>();
    this.runs((resident, first, count) => {
      let visible = isVisible.get(resident);
      if (visible === undefined) {
        visible = frustum.intersectsBox(resident.box);
        isVisible.set(resident, visible);
      }
      if (visible) visit(resident, first, count);
    });
  }

  /** Visits all runs of the cut. */
  protected runs(visit: (resident: ResidentGroup, first: number, count: number) => void): void {
    this.groups.forEach((resident, i) => {
      visit(resident, this.cut[3 * i], this.cut[3 * i + 1]);
    });
  }

  private addRun(resident: ResidentGroup, first: number, count: number, drawn: DrawCounts): void {
    const { group, arena, allocation } = resident;
    const { rangeOffsets, rangeTriangles, rangeMaterials } = group;
    const begin = rangeOffsets[first - group.firstCluster];
    const end = rangeOffsets[first - group.firstCluster + count];
    for (let i = begin; i < end; ++i) {
      const start = rangeTriangles[i];
      let j = i + 1;
      while (j < end && rangeMaterials[j] === rangeMaterials[i]) ++j;
      const triangles = rangeTriangles[j] - start;
      const batch = this.batch(arena, rangeMaterials[i]);
      batch.ranges.add(allocation.index + 3 * start, 3 * triangles);
      drawn.triangles += triangles;
      i = j - 1;
    }
    drawn.clusters += count;
  }

  private addLines(
    resident: ResidentGroup,
    first: number,
    count: number,
    material: Material,
  ): void {
    const { group, arena } = resident;
    let lines = this.lines.get(arena);
    if (!lines) {
      lines = this.add(new LineBatch(arena.lines(), material));
      this.lines.set(arena, lines);
    }
    const edges = arena.edgesOf(group);
    const begin = first - group.firstCluster;
    if (edges) lines.ranges.add(edges[begin], edges[begin + count] - edges[begin]);
  }

  private batch(arena: Arena, material: number): Batch {
    let batches = this.batches.get(arena);
    if (!batches) {
      batches = new Map();
      this.batches.set(arena, batches);
    }
    let batch = batches.get(material);
    if (!batch) {
      batch = this.add(new Batch(arena.geometry, this.materials.of(material, arena.layout)));
      batches.set(material, batch);
    }
    return batch;
  }

  protected add<T extends Batch | LineBatch>(object: T): T {
    setBounds(object, this.bounds);
    object.matrix.copy(this.matrix);
    this.parent.add(object);
    object.updateMatrixWorld(true);
    return object;
  }

  removeArena(arena: Arena): void {
    for (const batch of this.batches.get(arena)?.values() ?? []) this.parent.remove(batch);
    const line = this.lines.get(arena);
    if (line) this.parent.remove(line);
    this.batches.delete(arena);
    this.lines.delete(arena);
  }

  removeLines(): void {
    for (const batch of this.lines.values()) this.parent.remove(batch);
    this.lines.clear();
  }
}
