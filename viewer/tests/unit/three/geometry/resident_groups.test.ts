import { expect, test, vi } from "vitest";
import type { RenderGroup } from "../../../../packages/umbel/src/pack/render_group.js";
import type { MeshInfo } from "../../../../packages/umbel/src/stream/asset_info.js";
import type { Arena } from "../../../../packages/umbel/src/three/geometry/arena.js";
import {
  type ResidentGroup,
  ResidentGroups,
} from "../../../../packages/umbel/src/three/geometry/resident_groups.js";

const MESH: MeshInfo = { low: [0, 0, 0], high: [1, 1, 1], levels: 1, attributes: [], skipped: [] };

/** One cluster of some vertices, with as many triangles. */
function groupOf(group: number, vertices: number): RenderGroup {
  return {
    group,
    mesh: 0,
    firstCluster: group,
    clusterCount: 1,
    vertexOffsets: Uint32Array.of(0, vertices),
    triangleOffsets: Uint32Array.of(0, vertices),
    indices: new Uint32Array(3 * vertices),
    positions: new Float32Array(3 * vertices),
    generatingError: new Float32Array(1),
    boxes: new Float32Array(6),
  } as unknown as RenderGroup;
}

function residentsOf(budget: number, meshes = [MESH]): ResidentGroups {
  return new ResidentGroups(
    meshes,
    () => budget,
    () => {},
    () => {},
  );
}

function arenaOf(groups: ResidentGroups, group: number): Arena {
  return groups.get(group)?.arena as Arena;
}

test("buffers are no larger than the budget, and large enough for few of them", () => {
  for (const budget of [1 << 20, 1 << 22, 1 << 30]) {
    const groups = residentsOf(budget);
    groups.add(groupOf(0, 100));
    const { capacity, room } = arenaOf(groups, 0);
    expect(capacity).toBeLessThanOrEqual(budget);
    expect(capacity).toBeGreaterThan(Math.min(budget / 2, 1 << 22));
    expect(room).toBeLessThanOrEqual(1 << 17);
  }
  const groups = residentsOf(1 << 30);
  for (let i = 0; i < 512; ++i) groups.add(groupOf(i, 1000));
  const arenas = new Set(Array.from({ length: 512 }, (_, i) => arenaOf(groups, i)));
  expect(arenas.size).toBeLessThanOrEqual(Math.ceil(512 / 131) + 1);
});

test("layouts share the budget", () => {
  const budget = 1 << 22;
  const groups = residentsOf(budget, [MESH, { ...MESH, attributes: ["normals", "uvs"] }]);
  groups.add(groupOf(0, 100));
  groups.add({ ...groupOf(1, 100), mesh: 1 });
  expect(arenaOf(groups, 0)).not.toBe(arenaOf(groups, 1));
  expect(arenaOf(groups, 0).capacity + arenaOf(groups, 1).capacity).toBeLessThanOrEqual(budget);
});

test("a group that is larger than an arena has one of its own", () => {
  const groups = residentsOf(1 << 20);
  groups.add(groupOf(0, 200000));
  expect(arenaOf(groups, 0).room).toBe(200000);
});

test("edges are freed alone when they are no longer drawn", () => {
  const groups = residentsOf(1 << 20);
  groups.add(groupOf(0, 100));
  const arena = arenaOf(groups, 0);
  expect(groups.edgeRatio).toBe(0);
  const edges = arena.lines();
  const freed: string[][] = [];
  edges.addEventListener("dispose", () => freed.push(Object.keys(edges.attributes)));
  expect(arena.edgeBytes).toBeGreaterThan(0);
  expect(groups.edgeRatio).toBe(arena.edgeBytes / arena.capacity);
  groups.removeLines();
  // three.js frees the attributes that a geometry has, and the triangles still have theirs.
  expect(freed).toEqual([[]]);
  expect(Object.keys(arena.geometry.attributes)).toContain("position");
  expect(groups.edgeRatio).toBe(0);
  const group = groups.get(0)?.group as RenderGroup;
  expect(arena.edgesOf(group)).toBeUndefined();
  expect(arena.lines()).not.toBe(edges);
  expect(arena.edgesOf(group)).toBeDefined();
});

test("groups move together when buffers are larger than the budget", () => {
  let budget = 1 << 26;
  const freed: Arena[] = [];
  const groups = new ResidentGroups(
    [{ ...MESH, attributes: ["uvs"] }],
    () => budget,
    () => {},
    (arena) => freed.push(arena),
  );
  const uvsOf = (i: number) => Float32Array.from({ length: 2000 }, (_, at) => 2000 * i + at);
  for (let i = 0; i < 400; ++i) {
    const group = { ...groupOf(i, 1000), uvs: uvsOf(i) };
    group.indices.forEach((_, at) => {
      group.indices[at] = (at * 7 + i) % 1000;
    });
    groups.add(group);
  }
  expect(groups.compact()).toBe(false);
  const left = [3, 150, 250, 390];
  for (let i = 0; i < 400; ++i) if (!left.includes(i)) groups.remove(i);
  const capacity = () => [...new Set(left.map((i) => arenaOf(groups, i)))];
  expect(capacity().length).toBeGreaterThan(2);
  budget = 1 << 20;
  let steps = 0;
  while (groups.compact()) expect(++steps).toBeLessThan(10);
  expect(capacity().length).toBe(1);
  expect(capacity()[0]?.capacity).toBeLessThanOrEqual(budget);
  expect(freed.length).toBeGreaterThan(2);
  for (const i of left) {
    const { arena, allocation, group } = groups.byCluster.get(i) as ResidentGroup;
    expect(arena.geometry.attributes.uv?.array.slice(2 * allocation.vertex).slice(0, 2000)).toEqual(
      uvsOf(i),
    );
    expect(Array.from(allocation.indices.slice(0, 3), (at) => at - allocation.vertex)).toEqual(
      [0, 7, 14].map((at) => (at + i) % 1000),
    );
    expect(group.positions.length).toBe(0);
  }
});

test("a group that finds no memory leaves no trace, and may be added later", () => {
  const slots: number[] = [];
  const groups = new ResidentGroups(
    [MESH],
    () => 1 << 22,
    (count) => slots.push(count),
    () => {},
  );
  const [group, large] = [groupOf(0, 100), groupOf(1, 100_000)];
  const noMemory = () => {
    throw new RangeError("Array buffer allocation failed");
  };
  vi.stubGlobal("Float32Array", new Proxy(Float32Array, { construct: noMemory }));
  for (let attempt = 0; attempt < 3; ++attempt) expect(() => groups.add(group)).toThrow("failed");
  expect(() => groups.add(large)).toThrow("failed");
  vi.unstubAllGlobals();
  groups.add(group);
  expect(slots).toEqual([1, 1, 1, 1, 1]);
  const fresh = residentsOf(1 << 22);
  fresh.add(groupOf(0, 100));
  expect(arenaOf(groups, 0).capacity).toBe(arenaOf(fresh, 0).capacity);
  expect(arenaOf(groups, 0).isEmpty).toBe(false);
});
