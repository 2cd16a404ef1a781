// Selects from a tree of instances, as the library does (docs/instances.md): a node that must be
// refined shows what is in its page; where that is not loaded, its stand-ins stay.

import { NONE } from "../format/file_header.js";
import { type InstanceNodes, type Placements, ROWS } from "../format/instance_tree.js";
import type { Instance } from "../format/tables.js";
import { placedSphere, stretchOf } from "./placement.js";
import { isNodeOutside, isSphereOutside, mustRefine, timesTooLarge, type View } from "./select.js";

/** A page of placements, and of a leaf's what a step must know of each. */
export interface PlacementPage extends Placements {
  spheres: Float32Array;
  /** Error with the mesh's coarsest clusters. */
  error: Float32Array;
  /** The largest factor by which each transform changes lengths. */
  stretch: Float32Array;
}

/** Placements to show: of a node's page, or, where `node` is NONE, of the listed instances. */
export interface InstanceRun {
  node: number;
  first: number;
  count: number;
  /** Whether the coarsest clusters of their meshes are fine enough. */
  isCoarsest: boolean;
}

export interface InstanceStep {
  runs: InstanceRun[];
  /** Nodes whose pages are wanted, the most urgent first. */
  missing: number[];
  shown: number;
  standIns: number;
}

/** What the selector must know of a mesh. */
export interface InstancedMesh {
  low: ArrayLike<number>;
  high: ArrayLike<number>;
  coarsestError: number;
}

const EMPTY = new Float32Array(0);

export class InstanceSelector {
  /** Of loaded pages. */
  bytes = 0;
  /** The listed instances as a page. */
  readonly top: PlacementPage;
  private readonly pages = new Map<number, PlacementPage>();
  /** When each page was last of use; in that order. */
  private readonly lastStep = new Map<number, number>();
  private steps = 0;

  constructor(
    readonly nodes: InstanceNodes,
    private readonly meshes: readonly InstancedMesh[],
    listed: readonly Instance[],
    private maxBytes: number,
  ) {
    this.top = pageOfInstances(listed);
  }

  /** Placements of a run. */
  page(node: number): PlacementPage {
    return node === NONE ? this.top : (this.pages.get(node) as PlacementPage);
  }

  has(node: number): boolean {
    return this.pages.has(node);
  }

  /** Pages beyond so many bytes stay only while the last step needed them. */
  setBudget(bytes: number): void {
    this.maxBytes = bytes;
  }

  add(node: number, placements: Placements): void {
    if (this.pages.has(node)) return;
    const isLeaf = this.nodes.children[node] === 0;
    const page = isLeaf ? this.leafPage(placements) : withoutBounds(placements);
    this.pages.set(node, page);
    this.lastStep.set(node, this.steps);
    this.bytes += bytesOf(page);
  }

  private leafPage(placements: Placements): PlacementPage {
    const { count, rows, mesh } = placements;
    const spheres = new Float32Array(4 * count);
    const error = new Float32Array(count);
    const stretch = new Float32Array(count);
    for (let i = 0; i < count; ++i) {
      const { low, high, coarsestError } = this.meshes[mesh[i]] as InstancedMesh;
      placedSphere(low, high, rows, ROWS * i, spheres, 4 * i);
      stretch[i] = stretchOf(rows, ROWS * i)[1];
      error[i] = Math.min(coarsestError * stretch[i], 3.4028234663852886e38);
    }
    return { ...placements, spheres, error, stretch };
  }

  /**
   * What a view of the scene shows of what is loaded, without what lies outside the planes.
   * @returns undefined where that would be more than `mostShown` placements
   */
  step(view: View, planes: ArrayLike<number>, mostShown = Infinity): InstanceStep | undefined {
    ++this.steps;
    const step: InstanceStep = { runs: [], missing: [], shown: 0, standIns: 0 };
    const urgency = new Map<number, number>();
    const { nodes } = this;
    const stack: [number, number][] = [[0, NONE]];
    for (let next = stack.pop(); next; next = stack.pop()) {
      const [n, parent] = next;
      if (isNodeOutside(planes, nodes.spheres, n)) continue;
      const isFiner = mustRefine(nodes.spheres, n, nodes.error[n], 0, view);
      const page = isFiner ? this.pages.get(n) : undefined;
      if (isFiner && !page) urgency.set(n, timesTooLarge(nodes.spheres, n, nodes.error[n], view));
      if (!page) {
        step.standIns += nodes.standIns[n];
        show(step, parent, nodes.firstStandIn[n], nodes.standIns[n], true);
      } else {
        this.lastStep.delete(n);
        this.lastStep.set(n, this.steps);
        const children = nodes.children[n];
        if (children === 0) this.showLeaf(step, n, page, view, planes);
        // The first child is looked at first.
        for (let c = children - 1; c >= 0; --c) stack.push([nodes.firstChild[n] + c, n]);
      }
      if (step.shown > mostShown) return undefined;
    }
    const of = (n: number) => urgency.get(n) as number;
    step.missing = [...urgency.keys()].sort((a, b) => of(b) - of(a) || a - b);
    return step;
  }

  private showLeaf(
    step: InstanceStep,
    n: number,
    page: PlacementPage,
    view: View,
    planes: ArrayLike<number>,
  ): void {
    const { nodes } = this;
    const isCoarse = !mustRefine(nodes.spheres, n, nodes.coarsestError[n], 0, view);
    const [hidden, coarse, fine] = [0, 1, 2];
    let kind = hidden;
    let first = 0;
    for (let i = 0; i < page.count; ++i) {
      let now = coarse;
      if (isSphereOutside(planes, page.spheres, i)) now = hidden;
      else if (!isCoarse && mustRefine(page.spheres, i, page.error[i], 0, view)) now = fine;
      if (now === kind) continue;
      if (kind !== hidden) show(step, n, first, i - first, kind === coarse);
      kind = now;
      first = i;
    }
    if (kind !== hidden) show(step, n, first, page.count - first, kind === coarse);
  }

  /** Drops pages that the last step did not need, those that were longest not needed first. */
  evict(): void {
    for (const [node, last] of this.lastStep) {
      if (this.bytes <= this.maxBytes || last === this.steps) return;
      this.bytes -= bytesOf(this.pages.get(node) as PlacementPage);
      this.pages.delete(node);
      this.lastStep.delete(node);
    }
  }
}

function show(
  step: InstanceStep,
  node: number,
  first: number,
  count: number,
  isCoarsest: boolean,
): void {
  if (count === 0) return;
  step.shown += count;
  step.runs.push({ node, first, count, isCoarsest });
}

function withoutBounds(placements: Placements): PlacementPage {
  return { ...placements, spheres: EMPTY, error: EMPTY, stretch: EMPTY };
}

/** The listed instances as a page. */
export function pageOfInstances(listed: readonly Instance[]): PlacementPage {
  const rows = new Float32Array(ROWS * listed.length);
  listed.forEach(({ matrix }, i) => {
    rows.set(matrix, ROWS * i);
  });
  const mesh = Uint32Array.from(listed, (instance) => instance.mesh);
  return withoutBounds({ count: listed.length, rows, mesh });
}

function bytesOf({ rows, mesh, spheres, error, stretch }: PlacementPage): number {
  return [rows, mesh, spheres, error, stretch].reduce((sum, { byteLength }) => sum + byteLength, 0);
}
