// Turns a step of the tree of instances into rows: placements of a mesh that share a cut, so that one
// call draws them all. Far ones have the mesh's coarsest clusters; nearer ones share cuts by error, in
// steps of half an octave; the few that are near for their size have a view of their own.

import { NONE } from "../format/file_header.js";
import { type InstanceNodes, ROWS } from "../format/instance_tree.js";
import type { InstanceStep, PlacementPage } from "../select/instance_selector.js";
import { isMirrored, viewInMesh } from "../select/placement.js";
import { distanceOutside, type View } from "../select/select.js";
import type { MeshView } from "./target_cut.js";

/** Placements with views of their own, at most; and their distance, in radii of their sphere. */
const MAX_NEAR = 32;
const NEAR = 1;
/** Rows, at most; further ones have the mesh's coarsest clusters. */
const MAX_ROWS = 192;
/** Steps of errors in an octave, and the finest error of a row, in the mesh's coarsest. */
const STEPS = 2;
const FINEST = 2 ** -12;
const FLOATS = 16;

/** Placements of a mesh that share a cut. All of them mirror the mesh, or none does. */
export interface InstanceRow {
  /** The same for the same mesh and error, in one step and in the next. */
  key: string;
  mesh: number;
  /** From the mesh to the scene: columns of four, sixteen numbers each. */
  matrices: Float32Array;
  count: number;
  /** Whether it is one placement with a view of its own. */
  isOwn: boolean;
  /** The one nearest to the camera. */
  nearest: number;
}

interface OpenRow extends InstanceRow {
  /** Made from the key. */
  hash: number;
  view: View;
  nearestDistance: number;
}

export interface InstanceRows {
  rows: InstanceRow[];
  /** One a row. */
  views: MeshView[];
  /** Differs if other placements are shown, or with other errors. */
  hash: number;
}

/**
 * @param pageOf the placements of a node's page
 * @param nodes all nodes, if they are there
 * @param coarsestErrors of each mesh
 */
export function instanceRows(
  step: InstanceStep,
  pageOf: (node: number) => PlacementPage,
  nodes: InstanceNodes | undefined,
  coarsestErrors: ArrayLike<number>,
  view: View,
): InstanceRows {
  return new RowBuilder(coarsestErrors, view).build(step, pageOf, nodes);
}

class RowBuilder {
  private readonly open = new Map<string, OpenRow>();
  private near = 0;
  private hash = 0;

  constructor(
    private readonly coarsestErrors: ArrayLike<number>,
    private readonly view: View,
  ) {}

  build(
    step: InstanceStep,
    pageOf: (node: number) => PlacementPage,
    nodes: InstanceNodes | undefined,
  ): InstanceRows {
    for (const { node, first, count, isCoarsest } of step.runs) {
      const page = pageOf(node);
      const distance = nodes && node !== NONE ? this.distanceToNode(nodes, node) : 0;
      for (let i = first; i < first + count; ++i) {
        const row = isCoarsest ? this.coarsest(page, i) : this.fine(page, i, node);
        const from = isCoarsest ? distance : this.distanceTo(page, i);
        this.add(row, page, i, from);
        this.hash = mixed(mixed(mixed(this.hash, node), i), row.hash);
      }
    }
    const rows = [...this.open.values()];
    return {
      rows: rows.map(({ key, mesh, isOwn, matrices, count, nearest }) => ({
        key,
        mesh,
        isOwn,
        matrices: matrices.slice(0, FLOATS * count),
        count,
        nearest,
      })),
      views: rows.map(({ key, mesh, view }) => ({ key, mesh, view })),
      hash: this.hash,
    };
  }

  private coarsest(page: PlacementPage, i: number): OpenRow {
    return this.row(meshKey(page, i), page.mesh[i], { kind: "error", error: 3e38 });
  }

  private fine(page: PlacementPage, i: number, node: number): OpenRow {
    const mesh = page.mesh[i];
    const coarsest = this.coarsestErrors[mesh];
    const own = this.ownView(page, i);
    if (own) return this.row(`${node}.${i}`, mesh, own, true);
    const allowed = this.allowedError(page, i) / page.stretch[i];
    const step = Math.floor(STEPS * Math.log2(Math.max(allowed, FINEST * coarsest)));
    const error = 2 ** (step / STEPS);
    const key = `${meshKey(page, i)}:${step}`;
    if (error >= coarsest || (this.open.size >= MAX_ROWS && !this.open.has(key)))
      return this.coarsest(page, i);
    return this.row(key, mesh, { kind: "error", error });
  }

  /** The view of a placement that is near for its size; undefined for all others. */
  private ownView(page: PlacementPage, i: number): View | undefined {
    const isNear = this.distanceTo(page, i) < NEAR * page.spheres[4 * i + 3];
    if (this.view.kind !== "camera" || !isNear || this.near >= MAX_NEAR) return undefined;
    const own = viewInMesh(this.view, page.rows, ROWS * i);
    if (own) ++this.near;
    return own;
  }

  private row(key: string, mesh: number, view: View, isOwn = false): OpenRow {
    let row = this.open.get(key);
    if (!row) {
      const matrices = new Float32Array(FLOATS);
      const nearestDistance = Infinity;
      const hash = [...key].reduce((sum, letter) => mixed(sum, letter.charCodeAt(0)), 0);
      row = { key, hash, mesh, view, isOwn, matrices, count: 0, nearest: 0, nearestDistance };
      this.open.set(key, row);
    }
    return row;
  }

  private add(row: OpenRow, { rows }: PlacementPage, i: number, distance: number): void {
    if (FLOATS * row.count === row.matrices.length) {
      const larger = new Float32Array(2 * row.matrices.length);
      larger.set(row.matrices);
      row.matrices = larger;
    }
    const at = FLOATS * row.count;
    for (let j = 0; j < 3; ++j)
      for (let k = 0; k < 4; ++k) row.matrices[at + 4 * k + j] = rows[ROWS * i + 4 * j + k];
    row.matrices[at + 15] = 1;
    if (distance < row.nearestDistance) {
      row.nearestDistance = distance;
      row.nearest = row.count;
    }
    ++row.count;
  }

  private distanceToNode({ spheres }: InstanceNodes, node: number): number {
    if (this.view.kind !== "camera") return 0;
    return distanceOutside(spheres, node, this.view.eye);
  }

  private distanceTo(page: PlacementPage, i: number): number {
    return this.view.kind === "camera" ? distanceOutside(page.spheres, i, this.view.eye) : 0;
  }

  private allowedError(page: PlacementPage, i: number): number {
    if (this.view.kind === "error") return this.view.error;
    if (this.view.kind === "level") return 0;
    return this.view.threshold * this.distanceTo(page, i);
  }
}

/** Of the rows that a placement may be in. */
function meshKey({ rows, mesh }: PlacementPage, i: number): string {
  return `${isMirrored(rows, ROWS * i) ? "-" : ""}${mesh[i]}`;
}

function mixed(hash: number, value: number): number {
  return Math.imul(hash ^ value, 0x01000193);
}
