// The groups in GPU memory, and the arena that holds each.

import { Box3 } from "three";
import { UV_SETS } from "../../format/attributes.js";
import type { RenderGroup } from "../../pack/render_group.js";
import type { MeshInfo } from "../../stream/asset_info.js";
import { boxOf } from "../cluster_info.js";
import { Allocator } from "./allocator.js";
import { type Allocation, Arena, mostBytesPerVertex, type VertexLayout } from "./arena.js";

/** A group in GPU memory. */
export interface ResidentGroup {
  group: RenderGroup;
  arena: Arena;
  allocation: Allocation;
  box: Box3;
}

const MAX_SLOTS = 1 << 22;
/** Vertices from which the ratio of triangles to vertices is known, and the factor on it. */
const LEARNED = 1 << 15;
const ROOM = 1.1;
/** Bytes that a frame moves between buffers, about. */
const MAX_MOVED_BYTES = 1 << 20;
/** Share of a larger arena that is used at least, while buffers exceed the budget. */
const LEAST_FILL = 0.25;
/** Least and most vertices of an arena. */
const VERTICES = { low: 1 << 14, high: 1 << 17 };

export class ResidentGroups {
  /** The largest finite error of all groups so far. */
  coarsestError = 0;
  private readonly layouts: VertexLayout[];
  private readonly arenas = new Set<Arena>();
  private readonly groups = new Map<number, ResidentGroup>();
  /** The group of each resident cluster. */
  readonly byCluster = new Map<number, ResidentGroup>();
  private readonly slots = new Allocator(MAX_SLOTS);
  /** Of all groups so far: their ratio tells how large arenas' parts are best. */
  private vertices = 0;
  private triangles = 0;
  /** The budget for which no group can be moved, until others come or go. */
  private compactFor: number | undefined;

  /**
   * @param budget of geometry, in bytes
   * @param onSlots is called with the number of slots in use, at most
   * @param onArenaRemoved is called before an arena is freed
   */
  constructor(
    meshes: readonly MeshInfo[],
    private readonly budget: () => number,
    private readonly onSlots: (count: number) => void,
    private readonly onArenaRemoved: (arena: Arena) => void,
  ) {
    this.layouts = meshes.map(({ attributes }) => layoutOf(attributes));
  }

  /** Bytes of all buffers without edges. */
  private get capacity(): number {
    return [...this.arenas].reduce((sum, { capacity }) => sum + capacity, 0);
  }

  /** Bytes of edges, which are not counted for groups, for each byte of other buffers. */
  get edgeRatio(): number {
    const bytes = [...this.arenas].reduce((sum, { edgeBytes }) => sum + edgeBytes, 0);
    return bytes / Math.max(this.capacity, 1);
  }

  get(group: number): ResidentGroup | undefined {
    return this.groups.get(group);
  }

  /** Does nothing where the group is there. */
  add(group: RenderGroup): void {
    if (this.groups.has(group.group)) return;
    this.compactFor = undefined;
    const { arena, allocation } = this.place(group);
    this.vertices += group.positions.length / 3;
    this.triangles += group.indices.length / 3;
    const box = new Box3();
    for (let i = 0; i < group.clusterCount; ++i) box.union(boxOf(group, i));
    this.coarsestError = Math.max(this.coarsestError, ...group.generatingError);
    const resident = { group, arena, allocation, box };
    this.groups.set(group.group, resident);
    for (let i = 0; i < group.clusterCount; ++i)
      this.byCluster.set(group.firstCluster + i, resident);
  }

  private place(group: RenderGroup): { arena: Arena; allocation: Allocation } {
    const slot = this.slots.allocate(group.clusterCount);
    try {
      this.onSlots(slot + group.clusterCount);
      const placed = this.allocate(group, slot);
      if (placed) return placed;
      const arena = this.newArena(group);
      return { arena, allocation: arena.put(group, slot) as Allocation };
    } catch (error) {
      // There may be memory at the next attempt.
      this.slots.free(slot, group.clusterCount);
      throw error;
    }
  }

  /** Arenas of all layouts together are no larger than the budget, where groups allow it. */
  private newArena(group: RenderGroup): Arena {
    const layout = this.layouts[group.mesh] as VertexLayout;
    const different = this.layouts.filter(
      (other, i) => this.layouts.findIndex((first) => isSameLayout(first, other)) === i,
    );
    const bytes = Math.min(this.budget() / different.length, this.budget() - this.capacity);
    const vertices = Math.floor(bytes / mostBytesPerVertex(layout));
    const room = Math.min(Math.max(vertices, VERTICES.low), VERTICES.high);
    const ratio = (ROOM * this.triangles) / Math.max(this.vertices, 1);
    const arena = new Arena(layout, group, room, this.vertices > LEARNED ? ratio : undefined);
    this.arenas.add(arena);
    return arena;
  }

  private allocate(
    group: RenderGroup,
    slot: number,
  ): { arena: Arena; allocation: Allocation } | undefined {
    const layout = this.layouts[group.mesh] as VertexLayout;
    for (const arena of this.arenas) {
      if (!isSameLayout(arena.layout, layout)) continue;
      const allocation = arena.put(group, slot);
      if (allocation) return { arena, allocation };
    }
    return undefined;
  }

  remove(group: number): void {
    const resident = this.groups.get(group);
    if (!resident) return;
    this.compactFor = undefined;
    this.groups.delete(group);
    const { firstCluster, clusterCount } = resident.group;
    for (let i = 0; i < clusterCount; ++i) this.byCluster.delete(firstCluster + i);
    this.slots.free(resident.allocation.slot, resident.group.clusterCount);
    this.removeFrom(resident.arena, resident.group);
  }

  private removeFrom(arena: Arena, group: RenderGroup): void {
    arena.remove(group);
    if (!arena.isEmpty) return;
    this.onArenaRemoved(arena);
    this.arenas.delete(arena);
    arena.dispose();
  }

  /**
   * While all buffers are larger than the budget: moves some groups to fuller ones, to free the emptier
   * ones, and out of those that are too large. Returns whether it moved any.
   */
  compact(): boolean {
    const budget = this.budget();
    if (this.compactFor === budget || this.capacity <= budget) return false;
    const isTooLarge = ({ capacity, used, room }: Arena) =>
      capacity > budget || (room > VERTICES.low && used < LEAST_FILL * capacity);
    const arenas = [...this.arenas].sort((a, b) => a.used - b.used);
    for (const from of [...arenas.filter(isTooLarge), ...arenas.filter((a) => !isTooLarge(a))]) {
      const accepts = (to: Arena) =>
        to !== from && !isTooLarge(to) && (isTooLarge(from) || to.used >= from.used);
      if (this.moveFrom(from, accepts, isTooLarge(from))) return true;
    }
    this.compactFor = budget;
    return false;
  }

  /** Moves some groups of a buffer; `toNew`: into new ones where they fit into no other. */
  private moveFrom(from: Arena, accepts: (to: Arena) => boolean, toNew: boolean): boolean {
    const before = from.used;
    for (const [group, allocation] of [...from.allocations]) {
      const other = [...this.arenas].find(
        (to) => accepts(to) && isSameLayout(to.layout, from.layout) && to.fits(allocation),
      );
      if (!other && !toNew) continue;
      from.fill(group);
      const arena = other ?? this.newArena(group);
      const moved = { arena, allocation: arena.put(group, allocation.slot) };
      Object.assign(this.groups.get(group.group) as ResidentGroup, moved);
      this.removeFrom(from, group);
      if (before - from.used > MAX_MOVED_BYTES) break;
    }
    return from.used < before;
  }

  /** Frees the edges of all arenas. */
  removeLines(): void {
    for (const arena of this.arenas) arena.removeLines();
  }

  dispose(): void {
    for (const arena of this.arenas) arena.dispose();
    this.arenas.clear();
    this.groups.clear();
    this.byCluster.clear();
  }
}

function layoutOf(attributes: readonly string[]): VertexLayout {
  return {
    normals: attributes.includes("normals"),
    tangents: attributes.includes("tangents"),
    uvs: UV_SETS.map((set) => attributes.includes(set)),
    colors: attributes.includes("colors"),
  };
}

function isSameLayout(a: VertexLayout, b: VertexLayout): boolean {
  const isSame = a.normals === b.normals && a.tangents === b.tangents && a.colors === b.colors;
  return isSame && a.uvs.every((has, set) => has === b.uvs[set]);
}
