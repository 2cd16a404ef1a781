import { describe, expect, test } from "vitest";
import type { GroupGeometry } from "../../../../packages/umbel/src/decode/group.js";
import { FileQueue } from "../../../../packages/umbel/src/stream/file_queue.js";
import { materialRangesOf } from "../../../../packages/umbel/src/stream/material_ranges.js";
import { textureSizesOf } from "../../../../packages/umbel/src/stream/texture_sizes.js";
import {
  type PlannedImage,
  planSizes,
} from "../../../../packages/umbel/src/three/textures/texture_plan.js";

function image(wanted: number, size = 0, full = 4096, smallest = 256): PlannedImage {
  return { wanted, size, smallest, full, bytesOf: (side) => Math.ceil((16 / 3) * side * side) };
}

describe("the plan of sizes", () => {
  test("has each as large as it is seen, by halves of the full one", () => {
    const wanted = [1, 256, 257, 1000, 2049, 1e9, Infinity];
    const sizes = planSizes(
      wanted.map((texels) => image(texels)),
      Infinity,
    );
    expect(sizes).toEqual([256, 256, 512, 1024, 4096, 4096, 4096]);
  });

  test("asks for nothing of what is not seen, and keeps what is there", () => {
    expect(planSizes([image(0), image(0, 512), image(300, 2048)], Infinity)).toEqual([
      0, 512, 2048,
    ]);
  });

  test("keeps to the memory, and takes it from what is seen smallest", () => {
    let seed = 7;
    const random = () => {
      seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
      return seed / 2 ** 32;
    };
    for (let round = 0; round < 50; ++round) {
      const images = Array.from({ length: 20 }, () =>
        image(
          random() < 0.3 ? 0 : 4096 * random(),
          random() < 0.5 ? 0 : 2 ** Math.ceil(8 + 4 * random()),
        ),
      );
      const limit = 5e6 + 2e8 * random();
      const sizes = planSizes(images, limit);
      const bytes = images.reduce((sum, each, i) => sum + each.bytesOf(sizes[i]), 0);
      const isLeast = images.every(
        ({ smallest, size }, i) => sizes[i] <= Math.max(smallest, Math.min(size, smallest)),
      );
      expect(bytes <= limit || isLeast).toBe(true);
      images.forEach(({ wanted, smallest }, i) => {
        if (wanted > 0) expect(sizes[i]).toBeGreaterThanOrEqual(smallest);
      });
      // What nobody sees never keeps more than the smallest while something seen goes without.
      const isShort = images.some(
        ({ wanted }, i) => wanted > 0 && sizes[i] < wanted && sizes[i] < 4096,
      );
      if (isShort)
        images.forEach(({ wanted, size, smallest }, i) => {
          if (wanted === 0 && size > 0) expect(sizes[i]).toBeLessThanOrEqual(smallest);
        });
    }
  });
});

/** A source that answers when it is told to. */
class SlowSource {
  fetched = 0;
  readonly asked: { offset: number; length: number; answer(): void }[] = [];

  read(offset: number, length: number): Promise<Uint8Array> {
    return new Promise((resolve) => {
      const bytes = Uint8Array.from({ length }, (_, i) => (offset + i) % 251);
      this.asked.push({ offset, length, answer: () => resolve(bytes) });
    });
  }

  close(): void {}
}

const turn = () => new Promise((next) => setTimeout(next, 0));

describe("the queue of files", () => {
  test("reads small files that lie together by one request, each with its own bytes", async () => {
    const source = new SlowSource();
    const queue = new FileQueue(
      source,
      () => false,
      () => {},
    );
    const files = [3, 1, 0, 2].map((i) => ({ offset: 10_000 + 3000 * i, size: 2900 }));
    const reads = files.map((file) => queue.read(file, true));
    await turn();
    expect(source.asked.map(({ offset, length }) => [offset, length])).toEqual([[10_000, 11_900]]);
    source.asked[0].answer();
    (await Promise.all(reads)).forEach((bytes, i) => {
      expect(bytes.length).toBe(2900);
      expect(bytes[0]).toBe(files[i].offset % 251);
    });
  });

  test("has few requests at a time, and one while geometry is missing", async () => {
    for (const [isBusy, isUrgent, most] of [
      [false, false, 2],
      [true, false, 1],
      [true, true, 2],
    ] as const) {
      const source = new SlowSource();
      const queue = new FileQueue(
        source,
        () => isBusy,
        () => {},
      );
      const reads = [0, 1, 2, 3].map((i) => queue.read({ offset: 1e7 * i, size: 1e6 }, isUrgent));
      for (let i = 0; i < 4; ++i) {
        await turn();
        expect(queue.requests).toBeLessThanOrEqual(most);
        expect(source.asked.length).toBe(Math.min(i + most, 4));
        source.asked[i].answer();
      }
      await Promise.all(reads);
    }
  });

  test("takes what is urgent first, and goes on after a failure", async () => {
    const source = new SlowSource();
    const failing = { ...source, read: () => Promise.reject(new Error("gone")) };
    const queue = new FileQueue(
      failing as unknown as SlowSource,
      () => false,
      () => {},
    );
    await expect(queue.read({ offset: 0, size: 10 }, false)).rejects.toThrow("gone");
    expect(queue.requests).toBe(0);
    const ordered = new FileQueue(
      source,
      () => true,
      () => {},
    );
    for (const [i, isUrgent] of [false, false, true].entries())
      void ordered.read({ offset: 1e7 * i, size: 1e6 }, isUrgent);
    await turn();
    expect(source.asked[0].offset).toBe(2e7);
  });
});

/** Two clusters of two triangles each, on a square of two by two. */
function square(uvScale: number, materials?: number[]): GroupGeometry {
  const corners = [0, 0, 2, 0, 2, 2, 0, 2];
  const positions = new Float32Array(24);
  const uvs = new Float32Array(16);
  for (let v = 0; v < 8; ++v) {
    positions.set([corners[2 * (v % 4)], corners[2 * (v % 4) + 1], 5], 3 * v);
    uvs.set([uvScale * corners[2 * (v % 4)], uvScale * corners[2 * (v % 4) + 1]], 2 * v);
  }
  return {
    info: {
      clusterCount: 2,
      vertexOffsets: Uint32Array.of(0, 4, 8),
      triangleOffsets: Uint32Array.of(0, 2, 4),
      material: Uint32Array.of(7, 9),
    },
    indices: Uint32Array.of(0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7),
    values: { positions, uvs, ...(materials && { material: Float32Array.from(materials) }) },
  } as unknown as GroupGeometry;
}

test("a group tells how long a whole texture is on its surface", () => {
  const { sizeMaterials, sizes } = textureSizesOf(square(0.25));
  expect([...sizeMaterials]).toEqual([7, 9]);
  expect([...sizes]).toEqual([4, 4]);
  expect([...textureSizesOf(square(0)).sizes]).toEqual([0, 0]);
});

test("triangles of a cluster are ordered by material where clusters mix them", () => {
  const plain = materialRangesOf(square(1));
  expect([...plain.rangeOffsets]).toEqual([0, 1, 2]);
  expect([...plain.rangeMaterials]).toEqual([7, 9]);
  const mixed = square(1, [3, 1, 1, 1, 2, 2, 2, 2]);
  mixed.indices.set([0, 1, 2, 1, 2, 3]);
  const parts = materialRangesOf(mixed);
  expect([...parts.rangeOffsets]).toEqual([0, 2, 3]);
  expect([...parts.rangeMaterials]).toEqual([1, 3, 2]);
  expect([...parts.rangeTriangles]).toEqual([0, 1, 2, 4]);
  expect([...mixed.indices.subarray(0, 6)]).toEqual([1, 2, 3, 0, 1, 2]);
});
