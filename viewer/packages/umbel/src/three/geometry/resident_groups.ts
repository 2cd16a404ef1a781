// The groups that are in memory, and where on the GPU each is.

import { Box3 } from "three";
import { UV_SETS } from "../../format/attributes.js";
import type { RenderGroup } from "../../stream/render_group.js";
import type { MeshInfo } from "../../stream/streamer.js";
import { boxOf } from "../cluster_info.js";
import { Allocator } from "./allocator.js";
import { Arena, type Layout, type Place } from "./arena.js";

/** A group in memory and where it is. */
export interface Resident {
  group: RenderGroup;
  arena: Arena;
  place: Place;
  box: Box3;
}

const MAX_SLOTS = 1 << 22;

export class Residents {
  /** The greatest error that is not infinite, of what has arrived. */
  coarsestError = 0;
  private readonly layouts: Layout[];
  private readonly arenas = new Set<Arena>();
  private readonly groups = new Map<number, Resident>();
  private readonly slots = new Allocator(MAX_SLOTS);

  /**
   * @param onSlots is told how many places for clusters are needed
   * @param onArenaGone is told when a piece of memory is freed
   */
  constructor(
    meshes: readonly MeshInfo[],
    private readonly onSlots: (count: number) => void,
    private readonly onArenaGone: (arena: Arena) => void,
  ) {
    this.layouts = meshes.map(({ attributes }) => layoutOf(attributes));
  }

  get(group: number): Resident | undefined {
    return this.groups.get(group);
  }

  byCluster(): Map<number, Resident> {
    const found = new Map<number, Resident>();
    for (const resident of this.groups.values()) {
      const { firstCluster, clusterCount } = resident.group;
      for (let c = firstCluster; c < firstCluster + clusterCount; ++c) found.set(c, resident);
    }
    return found;
  }

  add(group: RenderGroup): void {
    const slot = this.slots.take(group.clusterCount);
    this.onSlots(slot + group.clusterCount);
    let [arena, place] = this.findRoom(group, slot);
    if (!place) {
      arena = new Arena(this.layouts[group.mesh] as Layout, group);
      this.arenas.add(arena);
      place = arena.put(group, slot);
    }
    const box = new Box3();
    for (let i = 0; i < group.clusterCount; ++i) box.union(boxOf(group, i));
    this.coarsestError = Math.max(this.coarsestError, ...group.generatingError);
    this.groups.set(group.group, { group, arena: arena as Arena, place: place as Place, box });
  }

  private findRoom(group: RenderGroup, slot: number): [Arena?, Place?] {
    const layout = this.layouts[group.mesh] as Layout;
    for (const arena of this.arenas) {
      if (!isSameLayout(arena.layout, layout)) continue;
      const place = arena.put(group, slot);
      if (place) return [arena, place];
    }
    return [];
  }

  remove(group: number): void {
    const resident = this.groups.get(group);
    if (!resident) return;
    this.groups.delete(group);
    this.slots.give(resident.place.slot, resident.group.clusterCount);
    resident.arena.remove(resident.group);
    if (!resident.arena.isEmpty) return;
    this.onArenaGone(resident.arena);
    this.arenas.delete(resident.arena);
    resident.arena.dispose();
  }

  dispose(): void {
    for (const arena of this.arenas) arena.dispose();
    this.arenas.clear();
    this.groups.clear();
  }
}

function layoutOf(attributes: readonly string[]): Layout {
  return {
    normals: attributes.includes("normals"),
    tangents: attributes.includes("tangents"),
    uvs: UV_SETS.map((set) => attributes.includes(set)),
    colors: attributes.includes("colors"),
  };
}

function isSameLayout(a: Layout, b: Layout): boolean {
  const isSame = a.normals === b.normals && a.tangents === b.tangents && a.colors === b.colors;
  return isSame && a.uvs.every((has, set) => has === b.uvs[set]);
}
