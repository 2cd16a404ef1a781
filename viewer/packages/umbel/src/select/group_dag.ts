// The known part of an asset's DAG of groups. Each page that arrives adds its groups and names their
// children. A group stays known after its geometry is evicted, until its page is forgotten.
//
// Known groups have numbers of their own, slots, so that memory and work depend on what is known and
// not on the asset. A slot is used again once its group is forgotten.

import type { GroupInfo } from "../decode/group.js";
import { corrupt } from "../errors.js";
import { type FileHeader, NONE } from "../format/file_header.js";
import type { GroupReference, MeshEntry } from "../format/tables.js";
import { mustRefine, type View } from "./select.js";

const EMPTY = new Uint32Array(0);
const FIRST_CAPACITY = 256;

/** A group without its references: its children are in `GroupDag.finer`. */
export type KnownGroup = Omit<GroupInfo, "references">;

/** Arrays have an element a slot, and `capacity` elements. */
export class GroupDag {
  /** Slots from here on were never used. */
  count = 0;
  /** The group in each slot; NONE where it is free. */
  group = new Uint32Array(0);
  /** Centre and radius, four a slot, and error: known with the first reference. */
  spheres = new Float32Array(0);
  error = new Float32Array(0);
  page = new Uint32Array(0);
  /** 1 where a group has clusters of the source mesh, which were made from no group. */
  hasSource = new Uint8Array(0);
  /** 1 where the geometry of a group is resident; see PageCache. */
  isResident = new Uint8Array(0);
  /** The record of each group; undefined until its page is read. */
  readonly info: (KnownGroup | undefined)[] = [];
  /** Slots of the children: the finer groups that its clusters were made from. */
  readonly finer: Uint32Array[] = [];
  /** Slots of the known parents: the groups that hold its simplified form. */
  readonly coarser: number[][] = [];
  /** For each cluster the slot of the group that it was made from; NONE for the source's. */
  readonly generating: Uint32Array[] = [];
  /** The slots of the groups of each page that is known. */
  readonly slotsOfPage = new Map<number, number[]>();
  private readonly slots = new Map<number, number>();
  private readonly freeSlots: number[] = [];
  private parents = new Uint32Array(0);
  /** Scratch memory of `traverse`: number of visited parents. */
  private reached = new Uint32Array(0);

  constructor(private readonly header: FileHeader) {
    for (const { roots } of header.meshes) for (const root of roots) this.addReference(root);
  }

  /** The slot of a group; undefined where it is not known. */
  slotOf(group: number): number | undefined {
    return this.slots.get(group);
  }

  /** The slots of a mesh's roots, which are always known. */
  rootsOf(mesh: number): number[] {
    const { roots } = this.header.meshes[mesh] as MeshEntry;
    return roots.map(({ group }) => this.slots.get(group) as number);
  }

  /** The groups of a known page. */
  groupsOf(page: number): number[] {
    return (this.slotsOfPage.get(page) ?? []).map((slot) => this.group[slot]);
  }

  /** The error of a known group. */
  errorOf(group: number): number {
    return this.error[this.slots.get(group) as number];
  }

  /** Adds the groups of a page. */
  add(page: number, infos: readonly GroupInfo[]): void {
    if (this.slotsOfPage.has(page)) return;
    if (new Set(infos.map(({ group }) => group)).size < infos.length)
      corrupt(`Page ${page} of the file has a group twice.`);
    for (const { group } of infos) {
      const slot = this.slots.get(group);
      if (slot !== undefined && (this.info[slot] || this.page[slot] !== page))
        corrupt(`Group ${group} of the file is in two pages.`);
    }
    const slots = infos.map((info) => this.addReference({ ...info, page }));
    this.slotsOfPage.set(page, slots);
    infos.forEach(({ references, ...info }, i) => {
      const slot = slots[i] as number;
      const children = references.map((reference) => this.addReference(reference));
      const slotOf = (group: number) => (group === NONE ? NONE : (this.slots.get(group) as number));
      this.info[slot] = info;
      this.finer[slot] = Uint32Array.from(children);
      this.generating[slot] = Uint32Array.from(info.generating, slotOf);
      this.hasSource[slot] = Number(info.generating.includes(NONE));
      for (const child of children) (this.coarser[child] as number[]).push(slot);
    });
  }

  /**
   * Forgets what a page told. No group of it may be refined anywhere. Its groups stay known where
   * another page refers to them.
   */
  forget(page: number): void {
    for (const slot of this.slotsOfPage.get(page) ?? []) {
      for (const child of this.finer[slot] as Uint32Array) {
        const coarser = this.coarser[child] as number[];
        coarser.splice(coarser.indexOf(slot), 1);
        this.freeIfUnnamed(child);
      }
      this.info[slot] = undefined;
      this.finer[slot] = this.generating[slot] = EMPTY;
      this.hasSource[slot] = 0;
      this.freeIfUnnamed(slot);
    }
    this.slotsOfPage.delete(page);
  }

  /** Frees the slot of a group that neither its own page nor another one tells of. */
  private freeIfUnnamed(slot: number): void {
    const isNamed = this.info[slot] || (this.coarser[slot] as number[]).length > 0;
    if (isNamed || this.parents[slot] === 0 || this.group[slot] === NONE) return;
    this.slots.delete(this.group[slot]);
    this.group[slot] = NONE;
    this.freeSlots.push(slot);
  }

  private addReference({ group, page, parents, error, sphere }: GroupReference): number {
    const known = this.slots.get(group);
    if (known !== undefined) return known;
    const slot = this.freeSlots.pop() ?? this.count++;
    if (slot >= this.group.length) this.grow();
    this.slots.set(group, slot);
    this.group[slot] = group;
    this.page[slot] = page;
    this.parents[slot] = parents;
    this.error[slot] = error;
    this.spheres.set(sphere, 4 * slot);
    this.hasSource[slot] = this.isResident[slot] = 0;
    this.info[slot] = undefined;
    this.finer[slot] = this.generating[slot] = EMPTY;
    this.coarser[slot] = [];
    return slot;
  }

  private grow(): void {
    const capacity = Math.max(FIRST_CAPACITY, 2 * this.group.length);
    this.group = grown(this.group, new Uint32Array(capacity));
    this.spheres = grown(this.spheres, new Float32Array(4 * capacity));
    this.error = grown(this.error, new Float32Array(capacity));
    this.page = grown(this.page, new Uint32Array(capacity));
    this.hasSource = grown(this.hasSource, new Uint8Array(capacity));
    this.isResident = grown(this.isResident, new Uint8Array(capacity));
    this.parents = grown(this.parents, new Uint32Array(capacity));
    this.reached = grown(this.reached, new Uint32Array(capacity));
  }

  /**
   * Visits the groups of a mesh that a view refines, from coarse to fine, by their slots. It visits a
   * group only after `visit` has answered true for all of its parents.
   */
  traverse(mesh: number, view: View, visit: (slot: number) => boolean): void {
    const { reached } = this;
    const touched: number[] = [];
    const stack = this.rootsOf(mesh);
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
  parentsOf(slot: number): number {
    return this.parents[slot];
  }

  mustRefine(slot: number, view: View): boolean {
    // A level is known once the page is read. Until then the group is refined, so its page is read.
    const level = view.kind === "level" ? (this.info[slot]?.level ?? 0xffff) : 0;
    return mustRefine(this.spheres, slot, this.error[slot], level, view);
  }
}

function grown<T extends Float32Array | Uint32Array | Uint8Array>(old: T, larger: T): T {
  larger.set(old);
  return larger;
}
