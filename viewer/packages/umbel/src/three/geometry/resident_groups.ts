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

  /**
   * Bytes of buffers that no group uses, without the emptiest buffer, which is being filled; and those
   * of edges, which are not counted for groups.
   */
  get slack(): number {
    let [bytes, most] = [0, 0];
    for (const { capacity, used, edgeBytes } of this.arenas) {
      bytes += capacity - used + edgeBytes;
      most = Math.max(most, capacity - used);
    }
    return bytes - most;
  }

  get(group: number): ResidentGroup | undefined {
    return this.groups.get(group);
  }

  /** Does nothing where the group is there. */
  add(group: RenderGroup): void {
    if (this.groups.has(group.group)) return;
    this.vertices += group.positions.length / 3;
    this.triangles += group.indices.length / 3;
    const slot = this.slots.allocate(group.clusterCount);
    this.onSlots(slot + group.clusterCount);
    let [arena, allocation] = this.allocate(group, slot);
    if (!allocation) {
      arena = this.newArena(group);
      this.arenas.add(arena);
      allocation = arena.put(group, slot);
    }
    const box = new Box3();
    for (let i = 0; i < group.clusterCount; ++i) box.union(boxOf(group, i));
    this.coarsestError = Math.max(this.coarsestError, ...group.generatingError);
    const resident = { group, arena: arena as Arena, allocation: allocation as Allocation, box };
    this.groups.set(group.group, resident);
    for (let i = 0; i < group.clusterCount; ++i)
      this.byCluster.set(group.firstCluster + i, resident);
  }

  /** Arenas of all layouts together are no larger than the budget, where groups allow it. */
  private newArena(group: RenderGroup): Arena {
    const layout = this.layouts[group.mesh] as VertexLayout;
    const different = this.layouts.filter(
      (other, i) => this.layouts.findIndex((first) => isSameLayout(first, other)) === i,
    );
    const vertices = Math.floor(this.budget() / different.length / mostBytesPerVertex(layout));
    const room = Math.min(Math.max(vertices, VERTICES.low), VERTICES.high);
    const ratio = (ROOM * this.triangles) / Math.max(this.vertices, 1);
    return new Arena(layout, group, room, this.vertices > LEARNED ? ratio : undefined);
  }

  private allocate(group: RenderGroup, slot: number): [Arena?, Allocation?] {
    const layout = this.layouts[group.mesh] as VertexLayout;
    for (const arena of this.arenas) {
      if (!isSameLayout(arena.layout, layout)) continue;
      const allocation = arena.put(group, slot);
      if (allocation) return [arena, allocation];
    }
    return [];
  }

  remove(group: number): void {
    const resident = this.groups.get(group);
    if (!resident) return;
    this.groups.delete(group);
    const { firstCluster, clusterCount } = resident.group;
    for (let i = 0; i < clusterCount; ++i) this.byCluster.delete(firstCluster + i);
    this.slots.free(resident.allocation.slot, resident.group.clusterCount);
    resident.arena.remove(resident.group);
    if (!resident.arena.isEmpty) return;
    this.onArenaRemoved(resident.arena);
    this.arenas.delete(resident.arena);
    resident.arena.dispose();
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
