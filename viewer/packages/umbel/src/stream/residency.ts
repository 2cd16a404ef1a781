// Decides which pages to fetch, which to evict, and which cut to draw, under a budget of bytes.
//
// Selection runs over the known groups; each page that arrives makes more groups known. Where the
// selected cuts exceed the budget, groups are refined in the order of their visible error until the
// budget is used up.

import type { GroupInfo } from "../decode/group.js";
import type { FileHeader } from "../format/file_header.js";
import { GroupDag } from "../select/group_dag.js";
import { keepDrawable, nextRefinement } from "../select/refinement.js";
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
  /** 1 for each group to refine. */
  target: Uint8Array;
  /** 1 for each group that is refined in what is drawn. */
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
  private isWanted: Uint8Array;
  /** Part of the budget for the selected cuts; it shrinks while drawn pages leave no room. */
  private share = MAX_SHARE;

  /** @param memoryOf bytes that a group takes */
  constructor(
    private readonly header: FileHeader,
    budget: number,
    memoryOf: (info: GroupInfo) => number,
  ) {
    this.dag = new GroupDag(header);
    this.isWanted = new Uint8Array(header.pages.count);
    this.cache = new PageCache(header, this.dag, budget, memoryOf, () => {
      const drawn = new Uint8Array(header.pages.count);
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

  setViews(views: readonly MeshView[]): void {
    this.share = Math.min(1.1 * this.share, MAX_SHARE);
    const { count } = this.dag;
    this.views = views.map(({ mesh, view }, i) => {
      const before = this.views[i]?.mesh === mesh ? this.views[i] : undefined;
      return {
        mesh,
        view,
        target: before?.target ?? new Uint8Array(count),
        refined: before?.refined ?? new Uint8Array(count),
      };
    });
  }

  get viewCount(): number {
    return this.views.length;
  }

  /** 1 for each group that is refined in what is drawn of a view. */
  refined(view: number): Uint8Array {
    return (this.views[view] as ViewState).refined;
  }

  /** Whether a view selects the refinement of a group that it draws unrefined. */
  isPending(view: number, group: number): boolean {
    const state = this.views[view] as ViewState;
    if (this.dag.info[group]) return state.target[group] === 1;
    return this.scale === 1 && this.dag.mustRefine(group, state.view);
  }

  /** Whether the selected cuts are drawn. */
  get isSettled(): boolean {
    if (this.wanted.missing > 0) return false;
    return this.views.every(({ target, refined }) => target.every((t, g) => t === refined[g]));
  }

  /** Selects again, and decides what to fetch and draw; whether other clusters are drawn now. */
  plan(): boolean {
    this.cache.beginRound();
    const limit = this.share * this.cache.budget;
    let cut = targetCut(this.dag, this.views, this.state.length);
    if (this.cache.memoryOfPages(cut.needed) > limit)
      cut = targetCutWithin(limit, this.dag, this.views, this.cache, (mesh) =>
        (this.header.meshes[mesh]?.roots ?? []).map(({ group }) => group),
      );
    this.scale = cut.scale;
    this.views.forEach((state, i) => {
      state.target = cut.targets[i] as Uint8Array;
    });
    this.queuePages(cut.needed);
    return this.redraw(({ target, refined }) =>
      nextRefinement(this.dag, target, refined, this.cache.isGroupResident),
    );
  }

  /** Sets what is drawn of each view; whether that changes anything. */
  private redraw(next: (state: ViewState) => Uint8Array): boolean {
    let hasChanged = false;
    for (const state of this.views) {
      const refined = next(state);
      hasChanged ||= refined.some((r, g) => r !== state.refined[g]);
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
      const evicted = this.cache.makeRoom(this.cache.memoryOfPage(page));
      if (!evicted && !this.cache.isPinned[page]) return undefined;
      this.load(page);
      return { page, evicted: evicted ?? [] };
    }
    return undefined;
  }

  /** Marks `page` as loading too, if it is to be fetched and fits without eviction. */
  takeAlso(page: number): boolean {
    if (!this.queue.has(page) || this.state[page] !== ABSENT) return false;
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
    if (this.isWanted[page] && this.state[page] === RESIDENT) --this.wanted.missing;
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
   */
  unblock(): void {
    const hasChanged = this.redraw(({ target }) => {
      const refined = target.slice();
      keepDrawable(this.dag, refined, this.cache.isGroupResident);
      return refined;
    });
    if (!hasChanged) this.share = Math.max(0.85 * this.share, MIN_SHARE);
  }

  /** Whether pages are still to be fetched, now or once there is room. */
  get hasAbsentPages(): boolean {
    for (const page of this.queue) if (this.state[page] === ABSENT) return true;
    return false;
  }

  private queuePages(needed: Uint8Array): void {
    this.isWanted = needed;
    this.wanted = { bytes: 0, fileBytes: this.fileBytes(needed), missing: 0 };
    const absent: number[] = [];
    for (let page = 0; page < needed.length; ++page) {
      if (!needed[page] || this.state[page] === DAMAGED) continue;
      this.cache.use(page);
      this.wanted.bytes += this.cache.memoryOfPage(page);
      if (this.state[page] !== RESIDENT) ++this.wanted.missing;
      if (this.state[page] === ABSENT) absent.push(page);
    }
    this.queue = new Set(this.byPriority(absent));
  }

  /** File bytes of the needed pages and of all pages above them. */
  private fileBytes(needed: Uint8Array): number {
    const isRead = needed.slice();
    for (const { target } of this.views)
      for (let g = 0; g < target.length; ++g) if (target[g]) isRead[this.dag.page[g]] = 1;
    let bytes = 0;
    for (let page = 0; page < isRead.length; ++page)
      if (isRead[page]) bytes += this.header.pages.size[page];
    return bytes;
  }

  /** Pages with the most visible error first. */
  private byPriority(pages: readonly number[]): number[] {
    if (pages.length < 2) return [...pages];
    const priority = new Map<number, number>();
    for (let group = 0; group < this.dag.count; ++group) {
      const page = this.dag.page[group];
      if (this.isWanted[page] && this.state[page] === ABSENT)
        priority.set(page, Math.max(priority.get(page) ?? 0, this.highestPriority(group)));
    }
    return [...pages].sort((a, b) => (priority.get(b) ?? 0) - (priority.get(a) ?? 0));
  }

  private highestPriority(group: number): number {
    return this.views.reduce(
      (max, { view }) => Math.max(max, priorityOf(this.dag, group, view)),
      0,
    );
  }
}
