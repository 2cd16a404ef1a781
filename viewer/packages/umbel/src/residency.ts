// Which pages are here, which to fetch next and which to let go, under a budget of bytes.
//
// What is wanted is found by selection; of that, the coarse comes first where it is much cheaper,
// so that something is seen soon. What does not fit the budget is wanted coarser: the allowed
// error grows for all alike until it does. A page that is drawn, or that the coarsest picture
// needs, never leaves.

import { type Dag, isDrawn, keepDrawable, makeDag, settle } from "./refinement.js";
import { distanceOutside, refinedGroups, type View } from "./select.js";
import type { Tables } from "./tables.js";

export const ABSENT = 0;
export const LOADING = 1;
export const RESIDENT = 2;
export const DAMAGED = 3;

/** By how much the allowed error grows or shrinks at a time to meet the budget. */
const STEP = 2 ** 0.25;
const LARGEST_SCALE = 2 ** 24;
const LEAST_THRESHOLD = 2 ** -20;
const LEAST_ERROR = 2 ** -40;
/** Of the budget, for what is wanted; the rest is for what is drawn until that is here. */
const SHARE = 0.75;
/** The allowed errors, in multiples, that are fetched one after the other. */
const STAGES = [64, 8, 1];
/** A coarser stage is fetched first if what it lacks is so many times less. */
const CHEAPER = 3;

interface ViewState {
  view: View;
  /** The groups to refine, and those refined in what is drawn. */
  target: Uint8Array;
  refined: Uint8Array;
}

export class Residency {
  readonly dag: Dag;
  readonly state: Uint8Array;
  /** Bytes that each page takes once it is here. */
  readonly pageBytes: Float64Array;
  /** Bytes of what is here or on its way. */
  bytes = 0;
  /** How many times the wanted error is allowed, to meet the budget. */
  scale = 1;
  /** Bytes, file bytes and number of pages of the cut that is wanted. */
  wanted = { bytes: 0, fileBytes: 0, missing: 0 };

  private readonly isResident: Uint8Array;
  private readonly isPinned: Uint8Array;
  private readonly lastUse: Float64Array;
  private views: ViewState[] = [];
  private queue = new Set<number>();
  private isWanted: Uint8Array;
  private tick = 0;

  constructor(
    private readonly tables: Tables,
    private budget: number,
    bytesPerVertex: number,
    bytesPerTriangle: number,
  ) {
    this.dag = makeDag(tables);
    const { pages, groups, clusters } = tables;
    this.state = new Uint8Array(pages.count);
    this.pageBytes = new Float64Array(pages.count);
    this.lastUse = new Float64Array(pages.count);
    this.isPinned = new Uint8Array(pages.count);
    this.isWanted = new Uint8Array(pages.count);
    this.isResident = new Uint8Array(groups.count);
    for (let g = 0; g < groups.count; ++g) {
      const end = groups.firstCluster[g] + groups.clusterCount[g];
      for (let c = groups.firstCluster[g]; c < end; ++c)
        this.pageBytes[groups.page[g]] +=
          clusters.vertices[c] * bytesPerVertex + clusters.triangles[c] * bytesPerTriangle;
      if (groups.error[g] === Infinity) this.isPinned[groups.page[g]] = 1;
    }
  }

  setBudget(bytes: number): void {
    this.budget = bytes;
  }

  setViews(views: readonly View[]): void {
    const { count } = this.tables.groups;
    this.views = views.map((view, i) => ({
      view,
      target: this.views[i]?.target ?? new Uint8Array(count),
      refined: this.views[i]?.refined ?? new Uint8Array(count),
    }));
  }

  get viewCount(): number {
    return this.views.length;
  }

  /** The groups that are refined in what is drawn of a view. */
  refined(view: number): Uint8Array {
    return this.views[view].refined;
  }

  /** The groups that should be. */
  target(view: number): Uint8Array {
    return this.views[view].target;
  }

  /** Whether everything wanted is drawn. */
  get isSettled(): boolean {
    return this.views.every(({ target, refined }) => target.every((t, g) => t === refined[g]));
  }

  /** Decides anew what is wanted and what to fetch, and lets go what must leave for it. */
  plan(): void {
    ++this.tick;
    this.fitScale();
    const fine = this.targets(this.scale);
    this.views.forEach((state, i) => {
      state.target = fine[i];
    });
    this.settle();
    this.makeQueue(fine);
  }

  /** Decides anew what is drawn of the views; whether that has changed. */
  settle(): boolean {
    let changed = false;
    for (const state of this.views) {
      const refined = settle(this.dag, state.target, state.refined, this.isResident);
      changed ||= refined.some((r, g) => r !== state.refined[g]);
      state.refined = refined;
    }
    return changed;
  }

  /** The next page to fetch, now marked as on its way, and those that leave for it. */
  next(): { page: number; evicted: number[] } | undefined {
    for (const page of this.queue) {
      if (this.state[page] !== ABSENT) {
        this.queue.delete(page);
        continue;
      }
      const evicted = this.makeRoom(this.pageBytes[page]);
      // Without its roots nothing could be drawn at all, however small the budget.
      if (!evicted && !this.isPinned[page]) return undefined;
      this.queue.delete(page);
      this.state[page] = LOADING;
      this.bytes += this.pageBytes[page];
      return { page, evicted: evicted ?? [] };
    }
    return undefined;
  }

  /** Takes `page` too, if it is among those to fetch and there is room without eviction. */
  takeAlso(page: number): boolean {
    if (!this.queue.has(page) || this.state[page] !== ABSENT) return false;
    if (this.bytes + this.pageBytes[page] > this.budget) return false;
    this.queue.delete(page);
    this.state[page] = LOADING;
    this.bytes += this.pageBytes[page];
    return true;
  }

  arrived(page: number): void {
    this.state[page] = RESIDENT;
    if (this.isWanted[page]) --this.wanted.missing;
    this.lastUse[page] = this.tick;
    this.markGroups(page, 1);
  }

  /** The page could not be had: for now, or for good. */
  failed(page: number, forGood: boolean): void {
    this.bytes -= this.pageBytes[page];
    this.state[page] = forGood ? DAMAGED : ABSENT;
  }

  /** Lets go what is over the budget, after it has shrunk. */
  trim(): number[] {
    return this.makeRoom(0) ?? [];
  }

  /**
   * When what is drawn leaves no room for what is wanted: draws only what is wanted or coarser,
   * and allows more error if that was so already.
   */
  unblock(): void {
    let changed = false;
    for (const state of this.views) {
      const refined = state.target.slice();
      keepDrawable(this.dag, refined, this.isResident);
      changed ||= refined.some((r, g) => r !== state.refined[g]);
      state.refined = refined;
    }
    if (!changed) this.scale = Math.min(this.scale * STEP, LARGEST_SCALE);
  }

  /** Whether something is still to be fetched, now or once there is room. */
  get isHungry(): boolean {
    for (const page of this.queue) if (this.state[page] === ABSENT) return true;
    return false;
  }

  private markGroups(page: number, value: number): void {
    for (const group of groupsOf(this.tables, page)) this.isResident[group] = value;
  }

  private targets(scale: number): Uint8Array[] {
    return this.views.map(({ view }) => {
      const target = new Uint8Array(this.tables.groups.count);
      refinedGroups(this.tables, scaled(view, scale), (group) => {
        target[group] = 1;
      });
      return target;
    });
  }

  /** The pages that some targets draw from. */
  private needed(targets: readonly Uint8Array[]): Uint8Array {
    const needed = new Uint8Array(this.tables.pages.count);
    const { page } = this.tables.groups;
    for (const target of targets)
      for (let g = 0; g < target.length; ++g)
        if (target[g] && !needed[page[g]] && isDrawn(this.dag, target, g)) needed[page[g]] = 1;
    return needed;
  }

  private bytesOf(needed: Uint8Array): number {
    return needed.reduce((sum, is, page) => (is ? sum + this.pageBytes[page] : sum), 0);
  }

  private fits(scale: number): boolean {
    return this.bytesOf(this.needed(this.targets(scale))) <= SHARE * this.budget;
  }

  private fitScale(): void {
    if (this.fits(this.scale)) {
      while (this.scale > 1 && this.fits(Math.max(this.scale / STEP, 1)))
        this.scale = Math.max(this.scale / STEP, 1);
    } else {
      do this.scale *= STEP;
      while (this.scale < LARGEST_SCALE && !this.fits(this.scale));
    }
  }

  private makeQueue(fine: readonly Uint8Array[]): void {
    const stages = STAGES.map((factor) => {
      const targets = factor === 1 ? fine : this.targets(this.scale * factor);
      const needed = this.needed(targets);
      const missing: number[] = [];
      let missingBytes = 0;
      for (let page = 0; page < needed.length; ++page) {
        if (!needed[page]) continue;
        this.lastUse[page] = this.tick;
        if (this.state[page] === RESIDENT) continue;
        missingBytes += this.pageBytes[page];
        if (this.state[page] === ABSENT) missing.push(page);
      }
      return { needed, missing, missingBytes };
    });
    const last = stages[stages.length - 1];
    this.isWanted = last.needed;
    this.wanted = { bytes: 0, fileBytes: 0, missing: 0 };
    last.needed.forEach((is, page) => {
      if (!is) return;
      this.wanted.bytes += this.pageBytes[page];
      this.wanted.fileBytes += this.tables.pages.size[page];
      if (this.state[page] !== RESIDENT) ++this.wanted.missing;
    });
    const queued = new Set<number>();
    for (let page = 0; page < this.isPinned.length; ++page)
      if (this.isPinned[page]) queued.add(page);
    for (let i = 0; i < stages.length; ++i) {
      const next = stages[i + 1];
      if (next && stages[i].missingBytes * CHEAPER > next.missingBytes) continue;
      for (const page of this.byPriority(stages[i].missing)) queued.add(page);
    }
    this.queue = queued;
  }

  /** Coarse before fine, and near before far. */
  private byPriority(pages: readonly number[]): number[] {
    const urgency = new Map(pages.map((page) => [page, this.urgency(page)]));
    return [...pages].sort((a, b) => (urgency.get(b) ?? 0) - (urgency.get(a) ?? 0));
  }

  private urgency(page: number): number {
    const { groups } = this.tables;
    let most = 0;
    for (const group of groupsOf(this.tables, page)) {
      const error = Math.min(groups.error[group], 3e38);
      for (const { view } of this.views) {
        if (view.kind !== "camera") most = Math.max(most, error);
        else {
          const [x, y, z] = view.eye;
          const distance = distanceOutside(groups.sphere, group, x, y, z);
          most = Math.max(most, error / Math.max(distance, groups.sphere[4 * group + 3] * 0.1));
        }
      }
    }
    return most;
  }

  /** Lets go the pages unused for longest until `bytes` fit; undefined if they cannot. */
  private makeRoom(bytes: number): number[] | undefined {
    if (this.bytes + bytes <= this.budget) return [];
    const inUse = this.inUse();
    const idle: number[] = [];
    for (let page = 0; page < this.state.length; ++page)
      if (this.state[page] === RESIDENT && !inUse[page] && !this.isPinned[page]) idle.push(page);
    idle.sort((a, b) => this.lastUse[a] - this.lastUse[b]);
    const evicted: number[] = [];
    let freed = 0;
    for (const page of idle) {
      if (this.bytes - freed + bytes <= this.budget) break;
      if (this.lastUse[page] === this.tick) break;
      freed += this.pageBytes[page];
      evicted.push(page);
    }
    if (bytes > 0 && this.bytes - freed + bytes > this.budget) return undefined;
    for (const page of evicted) {
      this.state[page] = ABSENT;
      this.markGroups(page, 0);
    }
    this.bytes -= freed;
    return evicted;
  }

  /** The pages that what is drawn needs. */
  private inUse(): Uint8Array {
    return this.needed(this.views.map(({ refined }) => refined));
  }
}

export function groupsOf({ pages }: Tables, page: number): number[] {
  return [pages.group[page]];
}

function scaled(view: View, scale: number): View {
  if (scale === 1) return view;
  // Views that allow no error at all must give way too.
  if (view.kind === "camera")
    return { ...view, threshold: Math.max(view.threshold, LEAST_THRESHOLD) * scale };
  if (view.kind === "error") return { ...view, error: Math.max(view.error, LEAST_ERROR) * scale };
  return { kind: "level", level: view.level + Math.ceil(Math.log2(scale)) };
}
