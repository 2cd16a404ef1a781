// Selects the groups to refine for each view, and the pages that the resulting cuts need: without a
// limit, or as much as a limit of memory allows.

import type { GroupDag } from "../select/group_dag.js";
import { isDrawn } from "../select/refinement.js";
import { distanceOutside, factorOf, type View } from "../select/select.js";
import type { PageCache } from "./page_cache.js";
import { PriorityQueue } from "./priority_queue.js";

const MAX_SCALE = 2 ** 24;
/** Least distance to a group that counts, in radii of its sphere. */
const NEAREST = 1e-3;

/** A view of a mesh. */
export interface MeshView {
  /** Names a view from one call to the next, where views come and go; else they keep their places. */
  key?: string;
  mesh: number;
  view: View;
}

export interface TargetCut {
  /** For each view, 1 for each slot whose group is to be refined. */
  targets: Uint8Array[];
  /** The pages that the cuts need. */
  needed: Set<number>;
  /** Factor on the allowed error that the limit of memory demands; 1 if it suffices. */
  scale: number;
}

/** Adds to `pages` those that some refinements draw from. */
export function addDrawnPages(
  dag: GroupDag,
  refinements: readonly Uint8Array[],
  pages: Set<number>,
): void {
  const { page } = dag;
  for (const refined of refinements)
    for (let g = 0; g < refined.length; ++g)
      if (refined[g] && !pages.has(page[g]) && isDrawn(dag, refined, g)) pages.add(page[g]);
}

/** Selects what the views ask for, as far as the DAG is known. */
export function targetCut(dag: GroupDag, views: readonly MeshView[]): TargetCut {
  const needed = new Set<number>();
  const targets = views.map(({ mesh, view }) => {
    const target = new Uint8Array(dag.count);
    dag.traverse(mesh, view, (group) => {
      if (!dag.info[group]) {
        needed.add(dag.page[group]);
        return false;
      }
      target[group] = 1;
      return true;
    });
    return target;
  });
  addDrawnPages(dag, targets, needed);
  return { targets, needed, scale: 1 };
}

/** Ratio of a group's error, unrefined, to the error that a view allows there. */
export function priorityOf(dag: GroupDag, group: number, view: View): number {
  const { spheres } = dag;
  const error = Math.min(dag.error[group], 3e38);
  if (view.kind === "level") return error;
  const factor = factorOf(spheres, group, view);
  if (view.kind === "error") return error / Math.max(view.error * factor, 1e-38);
  // Inside a sphere the distance is 0; there the groups with more error come first.
  const minDistance = NEAREST * spheres[4 * group + 3];
  const distance = Math.max(distanceOutside(spheres, group, view.eye), minDistance);
  return error / Math.max(view.threshold * factor * distance, 1e-38);
}

/**
 * Selects with a limit of bytes: refines groups in the order of their priority, for all views
 * together.
 */
export function targetCutWithin(
  limit: number,
  dag: GroupDag,
  views: readonly MeshView[],
  cache: PageCache,
): TargetCut {
  const selection = new LimitedSelection(limit, dag, views, cache);
  views.forEach(({ mesh }, view) => {
    for (const group of dag.rootsOf(mesh)) selection.offer(view, group);
  });
  selection.run();
  return {
    targets: selection.targets,
    needed: selection.pages.needed(),
    scale: Math.min(selection.scale, MAX_SCALE),
  };
}

class LimitedSelection {
  readonly targets: Uint8Array[];
  readonly pages: DrawnPages;
  scale = 1;
  /** For each view and group: number of parents that are refined. */
  private readonly reached: Map<number, number>[];
  private readonly queue = new PriorityQueue();

  constructor(
    private readonly limit: number,
    private readonly dag: GroupDag,
    private readonly views: readonly MeshView[],
    private readonly cache: PageCache,
  ) {
    this.targets = views.map(() => new Uint8Array(dag.count));
    this.reached = views.map(() => new Map<number, number>());
    this.pages = new DrawnPages(cache);
  }

  /** Queues a group whose parents are all refined. */
  offer(view: number, group: number): void {
    const priority = priorityOf(this.dag, group, (this.views[view] as MeshView).view);
    this.queue.push(priority, view * this.dag.count + group);
  }

  run(): void {
    const { count } = this.dag;
    for (let next = this.queue.pop(); next; next = this.queue.pop()) {
      const view = Math.floor(next.value / count);
      const group = next.value % count;
      if (!this.dag.mustRefine(group, (this.views[view] as MeshView).view)) continue;
      if (!this.refine(view, group)) this.scale = Math.max(this.scale, next.priority);
      else if (this.dag.info[group]) this.offerChildren(view, group);
    }
  }

  /** Refines a group; false if that exceeds the limit. A group that is not known only needs its page. */
  private refine(view: number, group: number): boolean {
    const { dag, pages } = this;
    const target = this.targets[view] as Uint8Array;
    const page = dag.page[group];
    pages.add(page);
    let hidden: number[] = [];
    if (dag.info[group]) {
      target[group] = 1;
      // Parents whose clusters are now all refined are not drawn any more.
      hidden = (dag.coarser[group] as number[]).filter((parent) => !isDrawn(dag, target, parent));
      for (const parent of hidden) pages.remove(dag.page[parent]);
    }
    if (pages.bytes <= this.limit || this.cache.isPinned[page]) return true;
    target[group] = 0;
    pages.remove(page);
    for (const parent of hidden) pages.add(dag.page[parent]);
    return false;
  }

  private offerChildren(view: number, group: number): void {
    const counts = this.reached[view] as Map<number, number>;
    for (const child of this.dag.finer[group] as Uint32Array) {
      const count = (counts.get(child) ?? 0) + 1;
      counts.set(child, count);
      if (count === this.dag.parentsOf(child)) this.offer(view, child);
    }
  }
}

/** Counts the drawn groups of each page, and the memory of the pages with any. */
class DrawnPages {
  bytes = 0;
  private readonly groups = new Map<number, number>();

  constructor(private readonly cache: PageCache) {}

  add(page: number): void {
    const count = this.groups.get(page) ?? 0;
    if (count === 0) this.bytes += this.cache.memoryOfPage(page);
    this.groups.set(page, count + 1);
  }

  remove(page: number): void {
    const count = (this.groups.get(page) as number) - 1;
    if (count > 0) this.groups.set(page, count);
    else {
      this.groups.delete(page);
      this.bytes -= this.cache.memoryOfPage(page);
    }
  }

  needed(): Set<number> {
    return new Set(this.groups.keys());
  }
}
