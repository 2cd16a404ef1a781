// What is known of an asset's groups, as pages tell it: which were made from which, and how far each
// may be from the source. What is known stays known when a page's geometry is let go.

import type { GroupInfo } from "../decode/page.js";
import { corrupt } from "../errors.js";
import { type Head, NONE, type Reference } from "../format/file_header.js";
import { mustRefine, type View } from "./select.js";

const EMPTY = new Uint32Array(0);

export class Catalog {
  /** How many groups there are, of all meshes. */
  readonly count: number;
  /** Centre and radius, four a group, and error: known with the first reference. */
  readonly spheres: Float32Array;
  readonly error: Float32Array;
  /** The page of each group; NONE while nothing is known of it. */
  readonly page: Uint32Array;
  /** What each group says of itself, once its page was read. */
  readonly info: (GroupInfo | undefined)[];
  /** For each group those that its clusters were made from. */
  readonly finer: Uint32Array[];
  /** For each group those that hold what it was simplified to, as far as they are known. */
  readonly coarser: number[][];
  /** 1 where some of a group's clusters were made from nothing. */
  readonly hasSource: Uint8Array;
  /** The groups of each page that was read. */
  readonly groupsOfPage: (number[] | undefined)[];
  private readonly parents: Uint32Array;
  private readonly reached: Uint32Array;

  constructor(private readonly head: Head) {
    const { groups, pages } = head;
    this.count = groups;
    this.spheres = new Float32Array(4 * groups);
    this.error = new Float32Array(groups);
    this.page = new Uint32Array(groups).fill(NONE);
    this.info = new Array(groups);
    this.finer = new Array<Uint32Array>(groups).fill(EMPTY);
    this.coarser = Array.from({ length: groups }, () => []);
    this.hasSource = new Uint8Array(groups);
    this.parents = new Uint32Array(groups);
    this.reached = new Uint32Array(groups);
    this.groupsOfPage = new Array(pages.count);
    for (const { roots } of head.meshes) for (const root of roots) this.name(root);
  }

  /** Takes what the groups of a page say. */
  add(page: number, infos: readonly GroupInfo[]): void {
    if (this.groupsOfPage[page]) return;
    for (const info of infos) {
      if (
        this.info[info.group] ||
        (this.page[info.group] !== NONE && this.page[info.group] !== page)
      )
        corrupt(`Group ${info.group} of the file is in two pages.`);
      this.name({ ...info, page });
    }
    this.groupsOfPage[page] = infos.map(({ group }) => group);
    for (const info of infos) {
      this.info[info.group] = info;
      this.finer[info.group] = Uint32Array.from(info.references, ({ group }) => group);
      if (info.generating.includes(NONE)) this.hasSource[info.group] = 1;
      for (const reference of info.references) {
        this.name(reference);
        (this.coarser[reference.group] as number[]).push(info.group);
      }
    }
  }

  private name({ group, page, parents, error, sphere }: Reference): void {
    if (this.page[group] !== NONE) return;
    this.page[group] = page;
    this.parents[group] = parents;
    this.error[group] = error;
    this.spheres.set(sphere, 4 * group);
  }

  /**
   * Calls `visit` with the groups of a mesh that a view refines, from coarse to fine; those behind a
   * group only if it answers true for all that the group was simplified to.
   */
  walk(mesh: number, view: View, visit: (group: number) => boolean): void {
    const { reached } = this;
    const touched: number[] = [];
    const stack = (this.head.meshes[mesh] as Head["meshes"][number]).roots.map(
      ({ group }) => group,
    );
    for (let g = stack.pop(); g !== undefined; g = stack.pop()) {
      if (!this.mustRefine(g, view) || !visit(g)) continue;
      const made = this.finer[g];
      for (let i = 0; i < made.length; ++i) {
        const finer = made[i];
        const count = ++reached[finer];
        if (count === 1) touched.push(finer);
        if (count === this.parents[finer]) stack.push(finer);
      }
    }
    for (const g of touched) reached[g] = 0;
  }

  /** How many groups hold what a group was simplified to. */
  parentsOf(group: number): number {
    return this.parents[group];
  }

  mustRefine(group: number, view: View): boolean {
    // A level is known only once the page was read, and its page is needed to know.
    const level = view.kind === "level" ? (this.info[group]?.level ?? 0xffff) : 0;
    return mustRefine(this.spheres, group, this.error[group], level, view);
  }
}
