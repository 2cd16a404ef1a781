// Which pages are here, which to fetch next and which to let go, under a budget of bytes.
//
// What is wanted is found by selection among the groups that are known; pages make more known. Where
// that does not fit the budget, groups are refined in the order of how much their error is seen, as
// far as the budget goes. A page that is drawn, or that holds the coarsest picture, never leaves.

import type { GroupInfo } from "../decode/page.js";
import type { Head } from "../format/file_header.js";
import { Catalog } from "../select/catalog.js";
import { isDrawn, keepDrawable, settle } from "../select/refinement.js";
import { distanceOutside, isSphereOutside, type View } from "../select/select.js";
import { Heap } from "./priority_queue.js";

export const ABSENT = 0;
export const LOADING = 1;
export const RESIDENT = 2;
export const DAMAGED = 3;

/** Of the budget, for what is wanted; the rest is for what is drawn until that is here. */
const SHARE = 0.75;
const LEAST_SHARE = 0.02;
const LARGEST_SCALE = 2 ** 24;
/** How near a group is at most taken to be, in its sphere's radii. */
const NEAREST = 1e-3;
/** Bytes that a page takes for each byte in the file, until a page was read. */
const FIRST_GROWTH = 10;

/** What is to be seen of a mesh. */
export interface MeshView {
  mesh: number;
  view: View;
}

interface ViewState extends MeshView {
  /** The groups to refine, and those refined in what is drawn. */
  target: Uint8Array;
  refined: Uint8Array;
}

export class Residency {
  readonly catalog: Catalog;
  readonly state: Uint8Array;
  /** Bytes of what is here or on its way. */
  bytes = 0;
  /** How many times the wanted error is seen where the budget allows no finer; 1 if it does. */
  scale = 1;
  /**
   * Memory of the cut that is wanted, file bytes of all pages that tell of its groups, and pages of
   * it that are not here yet.
   */
  wanted = { bytes: 0, fileBytes: 0, missing: 0 };

  /** Bytes that each page takes once it is here; guessed until it was read. */
  private readonly pageBytes: Float64Array;
  private growth = FIRST_GROWTH;
  private readBytes = 0;
  private readFileBytes = 0;
  private readonly isResident: Uint8Array;
  private readonly isPinned: Uint8Array;
  private readonly lastUse: Float64Array;
  private views: ViewState[] = [];
  private queue = new Set<number>();
  private isWanted: Uint8Array;
  private tick = 0;
  /** Of the budget, what is wanted may take; less while what is drawn stands in its way. */
  private share = SHARE;

  /** @param memoryOf the bytes that a group takes */
  constructor(
    private readonly head: Head,
    private budget: number,
    private readonly memoryOf: (info: GroupInfo) => number,
  ) {
    this.catalog = new Catalog(head);
    const { count } = head.pages;
    this.state = new Uint8Array(count);
    this.pageBytes = new Float64Array(count);
    this.lastUse = new Float64Array(count);
    this.isPinned = new Uint8Array(count);
    this.isWanted = new Uint8Array(count);
    this.isResident = new Uint8Array(head.groups);
    for (const { roots } of head.meshes) for (const { page } of roots) this.isPinned[page] = 1;
  }

  setBudget(bytes: number): void {
    this.budget = bytes;
    this.share = SHARE;
  }

  setViews(views: readonly MeshView[]): void {
    this.share = Math.min(1.1 * this.share, SHARE);
    const { count } = this.catalog;
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

  /** The groups that are refined in what is drawn of a view. */
  refined(view: number): Uint8Array {
    return (this.views[view] as ViewState).refined;
  }

  /** Whether a group that is not refined in what is drawn of a view should be. */
  waits(view: number, group: number): boolean {
    const state = this.views[view] as ViewState;
    if (this.catalog.info[group]) return state.target[group] === 1;
    return this.scale === 1 && this.catalog.mustRefine(group, state.view);
  }

  /** Whether everything wanted is drawn. */
  get isSettled(): boolean {
    if (this.wanted.missing > 0) return false;
    return this.views.every(({ target, refined }) => target.every((t, g) => t === refined[g]));
  }

  /** Decides anew what is wanted, what to fetch and what is drawn; whether that has changed. */
  plan(): boolean {
    ++this.tick;
    let { targets, needed } = this.wants();
    this.scale = 1;
    const limit = this.share * this.budget;
    if (this.memoryOfPages(needed) > limit) ({ targets, needed } = this.wantsWithin(limit));
    this.views.forEach((state, i) => {
      state.target = targets[i] as Uint8Array;
    });
    this.makeQueue(needed);
    return this.settle();
  }

  private settle(): boolean {
    let changed = false;
    for (const state of this.views) {
      const refined = settle(this.catalog, state.target, state.refined, this.isResident);
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
      const evicted = this.makeRoom(this.memoryOfPage(page));
      // Without its roots nothing could be drawn at all, however small the budget.
      if (!evicted && !this.isPinned[page]) return undefined;
      this.load(page);
      return { page, evicted: evicted ?? [] };
    }
    return undefined;
  }

  /** Takes `page` too, if it is among those to fetch and there is room without eviction. */
  takeAlso(page: number): boolean {
    if (!this.queue.has(page) || this.state[page] !== ABSENT) return false;
    if (this.bytes + this.memoryOfPage(page) > this.budget) return false;
    this.load(page);
    return true;
  }

  private load(page: number): void {
    this.queue.delete(page);
    this.state[page] = LOADING;
    this.pageBytes[page] = this.memoryOfPage(page);
    this.bytes += this.pageBytes[page];
  }

  /**
   * A page was read. The pages that leave for it, which may be itself if it is larger than it was
   * thought to be: then it is known, but not here.
   */
  arrived(page: number, infos: readonly GroupInfo[]): number[] {
    this.catalog.add(page, infos);
    const memory = infos.reduce((sum, info) => sum + this.memoryOf(info), 0);
    this.readBytes += memory;
    this.readFileBytes += this.head.pages.size[page];
    this.growth = this.readBytes / Math.max(this.readFileBytes, 1);
    this.bytes -= this.pageBytes[page];
    this.pageBytes[page] = memory;
    const evicted = this.makeRoom(memory);
    if (!evicted && !this.isPinned[page]) {
      this.state[page] = ABSENT;
      return [page];
    }
    this.bytes += memory;
    this.state[page] = RESIDENT;
    this.lastUse[page] = this.tick;
    if (this.isWanted[page]) --this.wanted.missing;
    for (const { group } of infos) this.isResident[group] = 1;
    return evicted ?? [];
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
   * and wants less if that was so already.
   */
  unblock(): void {
    let changed = false;
    for (const state of this.views) {
      const refined = state.target.slice();
      keepDrawable(this.catalog, refined, this.isResident);
      changed ||= refined.some((r, g) => r !== state.refined[g]);
      state.refined = refined;
    }
    if (!changed) this.share = Math.max(0.85 * this.share, LEAST_SHARE);
  }

  /** Whether something is still to be fetched, now or once there is room. */
  get isHungry(): boolean {
    for (const page of this.queue) if (this.state[page] === ABSENT) return true;
    return false;
  }

  private memoryOfPage(page: number): number {
    return this.catalog.groupsOfPage[page]
      ? (this.pageBytes[page] as number)
      : this.head.pages.size[page] * this.growth;
  }

  /** What the views refine, and the pages that are needed for it. */
  private wants(): { targets: Uint8Array[]; needed: Uint8Array } {
    const { catalog } = this;
    const needed = new Uint8Array(this.state.length);
    const targets = this.views.map(({ mesh, view }) => {
      const target = new Uint8Array(catalog.count);
      catalog.walk(mesh, view, (group) => {
        if (!catalog.info[group]) {
          needed[catalog.page[group]] = 1;
          return false;
        }
        target[group] = 1;
        return true;
      });
      return target;
    });
    this.addDrawn(targets, needed);
    return { targets, needed };
  }

  /** Adds the pages that some refinements draw from. */
  private addDrawn(refinements: readonly Uint8Array[], needed: Uint8Array): void {
    const { page } = this.catalog;
    for (const refined of refinements)
      for (let g = 0; g < refined.length; ++g)
        if (refined[g] && !needed[page[g]] && isDrawn(this.catalog, refined, g))
          needed[page[g]] = 1;
  }

  private memoryOfPages(needed: Uint8Array): number {
    let bytes = 0;
    for (let page = 0; page < needed.length; ++page)
      if (needed[page]) bytes += this.memoryOfPage(page);
    return bytes;
  }

  /** What the views refine with a limit of bytes: what is seen most first, of all views together. */
  private wantsWithin(limit: number): { targets: Uint8Array[]; needed: Uint8Array } {
    const { catalog, views } = this;
    const targets = views.map(() => new Uint8Array(catalog.count));
    const open = new OpenPages(this.state.length, (page) => this.memoryOfPage(page));
    const reached = views.map(() => new Map<number, number>());
    const heap = new Heap();
    const offer = (view: number, group: number) => {
      const urgency = this.urgency(group, (views[view] as ViewState).view);
      heap.push(urgency, view * catalog.count + group);
    };
    views.forEach(({ mesh }, view) => {
      for (const { group } of this.head.meshes[mesh]?.roots ?? []) offer(view, group);
    });
    for (let next = heap.pop(); next; next = heap.pop()) {
      const view = Math.floor(next.value / catalog.count);
      const group = next.value % catalog.count;
      const state = views[view] as ViewState;
      if (!catalog.mustRefine(group, state.view)) continue;
      const page = catalog.page[group];
      open.add(page);
      if (!catalog.info[group]) {
        if (open.bytes > limit && !this.isPinned[page]) {
          open.remove(page);
          this.scale = Math.max(this.scale, next.urgency);
        }
        continue;
      }
      const target = targets[view] as Uint8Array;
      target[group] = 1;
      // Groups that are refined all over are not drawn any more.
      const hidden = (catalog.coarser[group] as number[]).filter(
        (above) => !isDrawn(catalog, target, above),
      );
      for (const above of hidden) open.remove(catalog.page[above]);
      if (open.bytes > limit && !this.isPinned[page]) {
        target[group] = 0;
        open.remove(page);
        for (const above of hidden) open.add(catalog.page[above]);
        this.scale = Math.max(this.scale, next.urgency);
        continue;
      }
      const counts = reached[view] as Map<number, number>;
      for (const finer of catalog.finer[group] as Uint32Array) {
        const count = (counts.get(finer) ?? 0) + 1;
        counts.set(finer, count);
        if (count === catalog.parentsOf(finer)) offer(view, finer);
      }
    }
    this.scale = Math.min(this.scale, LARGEST_SCALE);
    return { targets, needed: open.needed() };
  }

  private makeQueue(needed: Uint8Array): void {
    this.isWanted = needed;
    this.wanted = { bytes: 0, fileBytes: 0, missing: 0 };
    const missing: number[] = [];
    for (let page = 0; page < needed.length; ++page) {
      if (!needed[page] || this.state[page] === DAMAGED) continue;
      this.lastUse[page] = this.tick;
      this.wanted.bytes += this.memoryOfPage(page);
      if (this.state[page] !== RESIDENT) ++this.wanted.missing;
      if (this.state[page] === ABSENT) missing.push(page);
    }
    this.queue = new Set(this.byPriority(missing));
    this.wanted.fileBytes = this.fileBytes(needed);
  }

  private fileBytes(needed: Uint8Array): number {
    const told = needed.slice();
    for (const { target } of this.views)
      for (let g = 0; g < target.length; ++g) if (target[g]) told[this.catalog.page[g]] = 1;
    let bytes = 0;
    for (let page = 0; page < told.length; ++page)
      if (told[page]) bytes += this.head.pages.size[page];
    return bytes;
  }

  /** Coarse before fine, and near before far. */
  private byPriority(pages: readonly number[]): number[] {
    if (pages.length < 2) return [...pages];
    const urgency = new Map<number, number>();
    for (let group = 0; group < this.catalog.count; ++group) {
      const page = this.catalog.page[group];
      if (this.isWanted[page] && this.state[page] === ABSENT)
        urgency.set(page, Math.max(urgency.get(page) ?? 0, this.greatestUrgency(group)));
    }
    return [...pages].sort((a, b) => (urgency.get(b) ?? 0) - (urgency.get(a) ?? 0));
  }

  private greatestUrgency(group: number): number {
    return this.views.reduce((most, { view }) => Math.max(most, this.urgency(group, view)), 0);
  }

  /** How many times the error that a view allows is seen of a group that is not refined. */
  private urgency(group: number, view: View): number {
    const { spheres } = this.catalog;
    const error = Math.min(this.catalog.error[group], 3e38);
    if (view.kind !== "camera") return error;
    // From within a sphere all of its groups are too coarse: then those with more error first.
    const least = NEAREST * spheres[4 * group + 3];
    const distance = Math.max(distanceOutside(spheres, group, view.eye), least);
    const isHidden = view.planes !== undefined && isSphereOutside(view.planes, spheres, group);
    const factor = isHidden ? (view.offscreen ?? 1) : 1;
    return error / Math.max(view.threshold * factor * distance, 1e-38);
  }

  /** Lets go the pages unused for longest until `bytes` fit; undefined if they cannot. */
  private makeRoom(bytes: number): number[] | undefined {
    if (this.bytes + bytes <= this.budget) return [];
    const inUse = new Uint8Array(this.state.length);
    this.addDrawn(
      this.views.map(({ refined }) => refined),
      inUse,
    );
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
      for (const group of this.catalog.groupsOfPage[page] ?? []) this.isResident[group] = 0;
    }
    this.bytes -= freed;
    return evicted;
  }
}

/** Pages with how many groups are drawn of each, and the memory of those with any. */
class OpenPages {
  bytes = 0;
  private readonly drawn: Uint32Array;

  constructor(
    pages: number,
    private readonly memoryOf: (page: number) => number,
  ) {
    this.drawn = new Uint32Array(pages);
  }

  add(page: number): void {
    if (this.drawn[page]++ === 0) this.bytes += this.memoryOf(page);
  }

  remove(page: number): void {
    if (--this.drawn[page] === 0) this.bytes -= this.memoryOf(page);
  }

  needed(): Uint8Array {
    return Uint8Array.from(this.drawn, (count) => Number(count > 0));
  }
}
