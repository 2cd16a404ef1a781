// Decides which pages to fetch, which to evict, and which cut to draw, under a budget of bytes.
//
// Selection runs over the known groups; each page that arrives makes more groups known. Where the
// selected cuts exceed the budget, groups are refined in the order of their visible error until the
// budget is used up.

import type { GroupInfo } from "../decode/group.js";
import { type FileHeader, NONE } from "../format/file_header.js";
import { sliceOf } from "../format/page_table.js";
import { GroupDag } from "../select/group_dag.js";
import { keepDrawable, nextRefinement } from "../select/refinement.js";
import type { View } from "../select/select.js";
import { ABSENT, DAMAGED, PageCache, RESIDENT } from "./page_cache.js";
import {
  addDrawnPages,
  type MeshView,
  priorityOf,
  targetCut,
  targetCutWithin,
} from "./target_cut.js";

/** Part of the budget for the selected cuts; the rest is for what is drawn until they arrive. */
const MAX_SHARE = 0.75;
const MIN_SHARE = 0.02;

interface ViewState extends MeshView {
  /** 1 for each slot whose group is to be refined; slots past the end are not. */
  target: Uint8Array;
  /** 1 for each slot whose group is refined in what is drawn. */
  refined: Uint8Array;
}

export class Residency {
  readonly dag: GroupDag;
  /** Factor on the allowed error that the budget demands; 1 if the budget suffices. */
  scale = 1;
  /** Memory of the selected cuts, file bytes of all pages that lead to them, and missing pages. */
  wanted = { bytes: 0, fileBytes: 0, missing: 0 };

  private readonly cache: PageCache;
  private views: ViewState[] = [];
  /** Pages to fetch, most urgent first. */
  private queue = new Set<number>();
  private needed = new Set<number>();
  /** Part of the budget for the selected cuts; it shrinks while drawn pages leave no room. */
  private share = MAX_SHARE;

  /**
   * @param memoryOf bytes that a group takes
   * @param maxIdlePages pages that stay known without being resident, beside those that views refine
   */
  constructor(
    private readonly header: FileHeader,
    budget: number,
    memoryOf: (info: GroupInfo) => number,
    private readonly maxIdlePages = 4096,
  ) {
    this.dag = new GroupDag(header);
    this.cache = new PageCache(header, this.dag, budget, memoryOf, () => {
      const drawn = new Set<number>();
      const refinements = this.views.map(({ refined }) => refined);
      addDrawnPages(this.dag, refinements, drawn);
      return drawn;
    });
  }

  /** The state of each page. */
  get state(): Uint8Array {
    return this.cache.state;
  }

  /** Memory of resident and loading pages. */
  get bytes(): number {
    return this.cache.bytes;
  }

  setBudget(bytes: number): void {
    this.cache.budget = bytes;
    this.share = MAX_SHARE;
  }

  /** Sets the budget where only what else takes memory has changed. */
  setRest(bytes: number): void {
    this.cache.budget = bytes;
  }

  setViews(views: readonly MeshView[]): void {
    this.share = Math.min(1.1 * this.share, MAX_SHARE);
    const before = this.views;
    const keyed = new Map(before.map((state) => [state.key, state]));
    this.views = views.map(({ key, mesh, view }, i) => {
      const same = key === undefined ? before[i] : keyed.get(key);
      const known = same?.mesh === mesh ? same : nearestOf(before, key, mesh, view);
      return {
        ...(key === undefined ? {} : { key }),
        mesh,
        view,
        target: known?.target ?? new Uint8Array(0),
        refined: known?.refined ?? new Uint8Array(0),
      };
    });
  }

  get viewCount(): number {
    return this.views.length;
  }

  /** 1 for each slot whose group is refined in what is drawn of a view. */
  refined(view: number): Uint8Array {
    return (this.views[view] as ViewState).refined;
  }

  /** Whether a view selects the refinement of a group that it draws unrefined. */
  isPending(view: number, slot: number): boolean {
    const state = this.views[view] as ViewState;
    if (this.dag.info[slot]) return state.target[slot] === 1;
    return this.scale === 1 && this.dag.mustRefine(slot, state.view);
  }

  /** Whether the selected cuts are drawn. */
  get isSettled(): boolean {
    if (this.wanted.missing > 0) return false;
    return this.views.every(({ target, refined }) => isSameSet(target, refined));
  }

  /** Selects again, and decides what to fetch and draw; whether other clusters are drawn now. */
  plan(): boolean {
    this.cache.beginRound();
    const limit = this.share * this.cache.budget;
    let cut = targetCut(this.dag, this.views);
    if (this.cache.memoryOfPages(cut.needed) > limit)
      cut = targetCutWithin(limit, this.dag, this.views, this.cache);
    this.scale = cut.scale;
    this.views.forEach((state, i) => {
      state.target = cut.targets[i] as Uint8Array;
    });
    this.queuePages(cut.needed);
    const hasChanged = this.redraw(({ target, refined }) =>
      nextRefinement(this.dag, target, refined, this.dag.isResident),
    );
    this.forgetIdlePages();
    return hasChanged;
  }

  /** Forgets the least recently used pages that are neither resident nor refined, if there are many. */
  private forgetIdlePages(): void {
    const idle = this.dag.slotsOfPage.size - this.cache.residentCount;
    if (idle <= this.maxIdlePages) return;
    let left = idle;
    for (const page of this.cache.idlePages()) {
      if (left <= 0.75 * this.maxIdlePages) break;
      const slots = this.dag.slotsOfPage.get(page) as number[];
      if (this.views.some((view) => slots.some((g) => view.target[g] || view.refined[g]))) continue;
      this.dag.forget(page);
      --left;
    }
  }

  /** See PageCache. */
  takeChanges(): Uint32Array {
    return this.cache.takeChanges();
  }

  /** Sets what is drawn of each view; whether that changes anything. */
  private redraw(next: (state: ViewState) => Uint8Array): boolean {
    let hasChanged = false;
    for (const state of this.views) {
      const refined = next(state);
      hasChanged ||= !isSameSet(refined, state.refined);
      state.refined = refined;
    }
    return hasChanged;
  }

  /** The next page to fetch, now marked as loading, and the pages evicted for it. */
  next(): { page: number; evicted: number[] } | undefined {
    for (const page of this.queue) {
      if (this.state[page] !== ABSENT) {
        this.queue.delete(page);
        continue;
      }
      if (!this.isListed(page)) continue;
      const evicted = this.cache.makeRoom(this.cache.memoryOfPage(page));
      if (!evicted && !this.cache.isPinned[page]) return undefined;
      this.load(page);
      return { page, evicted: evicted ?? [] };
    }
    return undefined;
  }

  /** Slices of the table of pages that pages to be fetched are in, and that are not read yet. */
  missingSlices(): Set<number> {
    const slices = new Set<number>();
    for (const page of this.queue) if (!this.isListed(page)) slices.add(sliceOf(page));
    return slices;
  }

  private isListed(page: number): boolean {
    return this.header.pages.isRead[sliceOf(page)] === 1;
  }

  /** Gives up all wanted pages of a slice of the table that cannot be read; returns their number. */
  failedSlice(slice: number): number {
    const pages = [...this.queue].filter((page) => sliceOf(page) === slice);
    for (const page of pages) this.cache.fail(page, true);
    return pages.length;
  }

  /** Marks `page` as loading too, if it is to be fetched and fits without eviction. */
  takeAlso(page: number): boolean {
    if (!this.queue.has(page) || this.state[page] !== ABSENT) return false;
    if (!this.isListed(page)) return false;
    if (!this.cache.fits(page)) return false;
    this.load(page);
    return true;
  }

  private load(page: number): void {
    this.queue.delete(page);
    this.cache.beginLoading(page);
  }

  /**
   * Takes a page that was read. Returns the evicted pages: the page itself where it turns out not to
   * fit; its groups stay known then.
   */
  arrived(page: number, infos: readonly GroupInfo[]): number[] {
    this.dag.add(page, infos);
    const evicted = this.cache.store(page, infos);
    if (this.needed.has(page) && this.state[page] === RESIDENT) --this.wanted.missing;
    return evicted;
  }

  /** Gives a page up that could not be read, for now or for good. */
  failed(page: number, forGood: boolean): void {
    this.cache.fail(page, forGood);
  }

  /** Evicts pages until the budget is met, after the budget has shrunk. */
  trim(): number[] {
    return this.cache.makeRoom(0) ?? [];
  }

  /**
   * Makes room where drawn pages leave none for the selected cuts: draws only groups of the selected
   * cuts or coarser ones. If that was so already, less is selected from now on.
   * @returns whether anything is different now
   */
  unblock(): boolean {
    const hasChanged = this.redraw(({ target }) => {
      const refined = target.slice();
      keepDrawable(this.dag, refined, this.dag.isResident);
      return refined;
    });
    if (hasChanged) return true;
    const before = this.share;
    this.share = Math.max(0.85 * before, MIN_SHARE);
    return this.share < before;
  }

  /** Whether pages are still to be fetched, now or once there is room. */
  get hasAbsentPages(): boolean {
    for (const page of this.queue) if (this.state[page] === ABSENT) return true;
    return false;
  }

  private queuePages(needed: Set<number>): void {
    this.needed = needed;
    this.wanted = { bytes: 0, fileBytes: this.fileBytes(needed), missing: 0 };
    const absent: number[] = [];
    for (const page of needed) {
      if (this.state[page] === DAMAGED) continue;
      this.cache.use(page);
      this.wanted.bytes += this.cache.memoryOfPage(page);
      if (this.state[page] !== RESIDENT) ++this.wanted.missing;
      if (this.state[page] === ABSENT) absent.push(page);
    }
    this.queue = new Set(this.byPriority(absent));
  }

  /** File bytes of the needed pages and of all pages above them. */
  private fileBytes(needed: Set<number>): number {
    const read = new Set(needed);
    for (const { target } of this.views)
      for (let g = 0; g < target.length; ++g) if (target[g]) read.add(this.dag.page[g]);
    let bytes = 0;
    for (const page of read) bytes += this.cache.sizeOf(page);
    return bytes;
  }

  /** Pages with the most visible error first; equal ones in the order of the file. */
  private byPriority(pages: readonly number[]): number[] {
    const priority = new Map(pages.map((page) => [page, 0]));
    for (let slot = 0; slot < this.dag.count; ++slot) {
      const before = priority.get(this.dag.page[slot]);
      if (before !== undefined && this.dag.group[slot] !== NONE)
        priority.set(this.dag.page[slot], Math.max(before, this.highestPriority(slot)));
    }
    const of = (page: number) => priority.get(page) as number;
    return [...pages].sort((a, b) => of(b) - of(a) || a - b);
  }

  private highestPriority(slot: number): number {
    return this.views.reduce((max, { view }) => Math.max(max, priorityOf(this.dag, slot, view)), 0);
  }
}

/** For a new view by error: the one of the same mesh whose error is most like it. */
function nearestOf(
  before: readonly ViewState[],
  key: string | undefined,
  mesh: number,
  view: View,
): ViewState | undefined {
  if (key === undefined || view.kind !== "error") return undefined;
  let best: ViewState | undefined;
  let least = Infinity;
  for (const state of before) {
    if (state.mesh !== mesh || state.view.kind !== "error") continue;
    const distance = Math.abs(Math.log(state.view.error / view.error));
    if (distance < least) [best, least] = [state, distance];
  }
  return best;
}

/** Whether two sets have the same elements; elements past the end of an array are not in it. */
function isSameSet(a: Uint8Array, b: Uint8Array): boolean {
  const [short, long] = a.length < b.length ? [a, b] : [b, a];
  return long.every((is, g) => is === (short[g] ?? 0));
}
