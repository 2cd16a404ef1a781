import { expect, test } from "vitest";
import type { RenderGroup } from "../../../../packages/umbel/src/pack/render_group.js";
import type { MeshInfo } from "../../../../packages/umbel/src/stream/asset_info.js";
import { ResidentGroups } from "../../../../packages/umbel/src/three/geometry/resident_groups.js";

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

function arenasOf(groups: ResidentGroups, count: number): Set<{ capacity: number; room: number }> {
  return new Set(Array.from({ length: count }, (_, i) => groups.get(i)?.arena as never));
}

test("a small asset takes little memory, and a large one few arenas", () => {
  const groups = new ResidentGroups(
    [MESH],
    () => {},
    () => {},
  );
  groups.add(groupOf(0, 100));
  const [first] = arenasOf(groups, 1);
  expect(first?.capacity).toBeLessThan(1 << 20);
  for (let i = 1; i < 512; ++i) groups.add(groupOf(i, 1000));
  const rooms = [...arenasOf(groups, 512)].map(({ room }) => room);
  expect(rooms.slice(0, 4)).toEqual([1 << 14, 1 << 14, 1 << 15, 1 << 16]);
  expect(rooms.length).toBeLessThanOrEqual(4 + Math.ceil(512000 / (1 << 17)));
});

test("a group that is larger than an arena has one of its own", () => {
  const groups = new ResidentGroups(
    [MESH],
    () => {},
    () => {},
  );
  groups.add(groupOf(0, 20000));
  expect(groups.get(0)?.arena.room).toBe(20000);
});
