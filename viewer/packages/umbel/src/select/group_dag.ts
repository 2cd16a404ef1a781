// The known part of an asset's DAG of groups. Each page that arrives adds its groups and names their
// children. A group stays known after its geometry is evicted.

import type { GroupInfo } from "../decode/group.js";
import { corrupt } from "../errors.js";
import { type FileHeader, NONE } from "../format/file_header.js";
import type { GroupReference, MeshEntry } from "../format/tables.js";
import { mustRefine, type View } from "./select.js";

const EMPTY = new Uint32Array(0);

export class GroupDag {
  /** Number of groups, of all meshes. */
  readonly count: number;
  /** Centre and radius, four a group, and error: known with the first reference. */
  readonly spheres: Float32Array;
  readonly error: Float32Array;
  /** The page of each group; NONE while no page has named the group. */
  readonly page: Uint32Array;
  /** The record of each group; undefined until its page is read. */
  readonly info: (GroupInfo | undefined)[];
  /** For each group its children: the finer groups that its clusters were made from. */
  readonly finer: Uint32Array[];
  /** For each group its known parents: the groups that hold its simplified form. */
  readonly coarser: number[][];
  /** 1 where a group has clusters of the source mesh, which were made from no group. */
  readonly hasSource: Uint8Array;
  /** The groups of each page that was read. */
  readonly groupsOfPage: (number[] | undefined)[];
  private readonly parents: Uint32Array;
  /** Scratch memory of `traverse`: number of visited parents. */
  private readonly reached: Uint32Array;

  constructor(private readonly header: FileHeader) {
    const { groups, pages } = header;
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
    for (const { roots } of header.meshes) for (const root of roots) this.addReference(root);
  }

  /** Adds the groups of a page. */
  add(page: number, infos: readonly GroupInfo[]): void {
    if (this.groupsOfPage[page]) return;
    for (const info of infos) {
      if (
        this.info[info.group] ||
        (this.page[info.group] !== NONE && this.page[info.group] !== page)
      )
        corrupt(`Group ${info.group} of the file is in two pages.`);
      this.addReference({ ...info, page });
    }
    this.groupsOfPage[page] = infos.map(({ group }) => group);
    for (const info of infos) {
      this.info[info.group] = info;
      this.finer[info.group] = Uint32Array.from(info.references, ({ group }) => group);
      if (info.generating.includes(NONE)) this.hasSource[info.group] = 1;
      for (const reference of info.references) {
        this.addReference(reference);
        (this.coarser[reference.group] as number[]).push(info.group);
      }
    }
  }

  private addReference({ group, page, parents, error, sphere }: GroupReference): void {
    if (this.page[group] !== NONE) return;
    this.page[group] = page;
    this.parents[group] = parents;
    this.error[group] = error;
    this.spheres.set(sphere, 4 * group);
  }

  /**
   * Visits the groups of a mesh that a view refines, from coarse to fine. It visits a group only
   * after `visit` has answered true for all of its parents.
   */
  traverse(mesh: number, view: View, visit: (group: number) => boolean): void {
    const { reached } = this;
    const touched: number[] = [];
    const stack = (this.header.meshes[mesh] as MeshEntry).roots.map(({ group }) => group);
    for (let g = stack.pop(); g !== undefined; g = stack.pop()) {
      if (!this.mustRefine(g, view) || !visit(g)) continue;
      const children = this.finer[g];
      for (let i = 0; i < children.length; ++i) {
        const child = children[i];
        const count = ++reached[child];
        if (count === 1) touched.push(child);
        if (count === this.parents[child]) stack.push(child);
      }
    }
    for (const g of touched) reached[g] = 0;
  }

  /** Number of a group's parents, known or not. */
  parentsOf(group: number): number {
    return this.parents[group];
  }

  mustRefine(group: number, view: View): boolean {
    // A level is known once the page is read. Until then the group is refined, so its page is read.
    const level = view.kind === "level" ? (this.info[group]?.level ?? 0xffff) : 0;
    return mustRefine(this.spheres, group, this.error[group], level, view);
  }
}
