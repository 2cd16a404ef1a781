import { describe, expect, test, vi } from "vitest";
import { UmbelError } from "../../../packages/umbel/src/errors.js";
import { cameraView, type View } from "../../../packages/umbel/src/select/select.js";
import { BlobSource, type ByteSource } from "../../../packages/umbel/src/source/source.js";
import { ABSENT, RESIDENT } from "../../../packages/umbel/src/stream/page_cache.js";
import type {
  StreamStatistics,
  StreamUpdate,
} from "../../../packages/umbel/src/stream/stream_update.js";
import { Streamer } from "../../../packages/umbel/src/stream/streamer.js";
import { type LoadedAsset, loadAsset, select } from "../../support/loaded_asset.js";

const PLANET = loadAsset("planet");
const { file: FILE, header: HEADER, dag: DAG } = PLANET;
const NEAR = [0, 0, 1.3] as const;
const HUGE = 2 ** 30;

class MemorySource implements ByteSource {
  fetched = 0;
  /** Whether the server refuses all requests. */
  isRefusing = false;
  readonly reads: [number, number][] = [];
  private readonly source: BlobSource;

  constructor(private readonly bytes: Uint8Array) {
    this.source = new BlobSource(new Blob([bytes as Uint8Array<ArrayBuffer>]));
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    this.reads.push([offset, length]);
    if (this.isRefusing) throw new UmbelError("refused", "The link has expired.");
    const part = await this.source.read(offset, length);
    this.fetched += part.length;
    return part;
  }

  get requests(): number {
    return this.reads.length;
  }

  get size(): number {
    return this.bytes.length;
  }

  close(): void {}
}

/** A stream with its updates so far. */
class Watched {
  readonly resident = new Set<number>();
  readonly updates: StreamUpdate[] = [];
  /** The states of pages that are not absent. */
  readonly pages = new Map<number, number>();
  cut: number[] = [];
  problems: string[] = [];
  private wake: (() => void) | undefined;
  streamer!: Streamer;

  private constructor(private readonly groupOf: Uint32Array) {}

  static async open(source: ByteSource, budget: number, asset = PLANET): Promise<Watched> {
    const watched = new Watched(groupsOf(asset));
    watched.streamer = await Streamer.open(source, { budget }, watched);
    return watched;
  }

  update(update: StreamUpdate): void {
    for (const group of update.removed) this.resident.delete(group);
    for (const { group } of update.added) this.resident.add(group);
    if (update.cuts) this.cut = this.expand(update.cuts[0]);
    if (update.statistics.residentBytes > update.statistics.budget) this.problems.push("budget");
    for (let i = 0; i < update.pages.length; i += 2) {
      if (update.pages[i + 1] === ABSENT) this.pages.delete(update.pages[i]);
      else this.pages.set(update.pages[i], update.pages[i + 1]);
    }
    this.updates.push({ ...update, added: [] });
    this.wake?.();
  }

  connection(): void {}

  failed(error: UmbelError): void {
    this.problems.push(error.message);
  }

  get last(): StreamStatistics {
    return this.updates[this.updates.length - 1].statistics;
  }

  async until(condition: (statistics: StreamStatistics) => boolean): Promise<void> {
    do
      await new Promise<void>((wake) => {
        this.wake = wake;
      });
    while (!condition(this.last));
  }

  private expand(runs: Uint32Array): number[] {
    const cut: number[] = [];
    for (let i = 0; i < runs.length; i += 3) {
      const group = this.groupOf[runs[i]];
      if (!this.resident.has(group)) this.problems.push(`group ${group} is drawn but not resident`);
      for (let c = runs[i]; c < runs[i] + runs[i + 1]; ++c) cut.push(c);
    }
    return cut.sort((a, b) => a - b);
  }
}

/** The group of each cluster. */
function groupsOf({ header, dag }: LoadedAsset): Uint32Array {
  const groups = new Uint32Array(header.clusters);
  for (const info of dag.info)
    if (info) groups.fill(info.group, info.firstCluster, info.firstCluster + info.clusterCount);
  return groups;
}

const GROUP_OF = groupsOf(PLANET);

function viewsOf(view: View): { mesh: number; view: View }[] {
  return [{ mesh: 0, view }];
}

test("reaches the library's cut from coarse to fine, with few bytes more than it has", async () => {
  const source = new MemorySource(FILE);
  const watched = await Watched.open(source, HUGE);
  const view = cameraView(NEAR, 0.8, 800, 2);
  watched.streamer.setViews(viewsOf(view));
  await watched.until((s) => s.isSettled && s.missingPages === 0);
  expect(watched.cut).toEqual(select(PLANET, view));
  expect(watched.problems).toEqual([]);
  const cuts = watched.updates.filter((u) => u.cuts).map((u) => u.statistics.triangles);
  expect(cuts.find((triangles) => triangles > 0)).toBeLessThan(watched.last.triangles / 8);
  expect(watched.last.fetchedBytes).toBeLessThan(
    1.3 * watched.last.wantedFileBytes + HEADER.fixed.headerBytes,
  );
});

test("tells which view and budget its counts are of", async () => {
  const watched = await Watched.open(new MemorySource(FILE), HUGE);
  watched.streamer.setViews(viewsOf(cameraView([0, 0, 20], 0.8, 800, 2)));
  await watched.until((s) => s.isSettled);
  expect(watched.last.revision).toBe(1);
  watched.streamer.setViews(viewsOf(cameraView(NEAR, 0.8, 800, 2)));
  watched.streamer.setBudget(HUGE / 2);
  await watched.until((s) => s.revision === 3);
  expect(watched.last.isSettled).toBe(false);
  await watched.until((s) => s.isSettled);
});

test("follows a camera within its budget, without holes", async () => {
  const budget = 8_000_000;
  const watched = await Watched.open(new MemorySource(FILE), budget);
  for (let i = 0; i < 40; ++i) {
    const angle = i / 4;
    const distance = 1.3 + (i % 10) / 4;
    const eye = [Math.sin(angle) * distance, 0.2, Math.cos(angle) * distance] as const;
    watched.streamer.setViews(viewsOf(cameraView(eye, 0.8, 900, 0.5)));
    const waits = i % 7 === 6 || i === 39;
    await watched.until((s) => !waits || (s.isSettled && s.missingPages === 0));
  }
  expect(watched.problems).toEqual([]);
  expect(watched.updates.some((u) => u.statistics.scale > 1)).toBe(true);
  expect(watched.updates.some((u) => u.removed.length > 0)).toBe(true);
  expect(watched.last.triangles).toBeGreaterThan(20_000);
});

test("gets much coarser without fetching the levels between", async () => {
  const watched = await Watched.open(new MemorySource(FILE), HUGE);
  watched.streamer.setViews(viewsOf(cameraView(NEAR, 0.8, 900, 0.5)));
  await watched.until((s) => s.isSettled && s.missingPages === 0);
  const fine = watched.last.fetchedBytes;
  const view = cameraView([0, 0, 9], 0.8, 900, 16);
  watched.streamer.setViews(viewsOf(view));
  await watched.until((s) => s.isSettled && s.missingPages === 0);
  expect(watched.cut).toEqual(select(PLANET, view));
  expect(watched.last.fetchedBytes - fine).toBeLessThan(fine / 4);
  expect(watched.problems).toEqual([]);
});

test("keeps a shrinking budget, and uses a growing one", async () => {
  const watched = await Watched.open(new MemorySource(FILE), HUGE);
  const view = cameraView(NEAR, 0.8, 900, 1);
  watched.streamer.setViews(viewsOf(view));
  await watched.until((s) => s.isSettled && s.missingPages === 0);
  const before = watched.last;
  watched.problems = [];
  watched.streamer.setBudget(before.residentBytes / 2);
  await watched.until(
    (s) => s.isSettled && s.missingPages === 0 && s.residentBytes <= before.residentBytes / 2,
  );
  expect(watched.last.triangles).toBeLessThan(before.triangles);
  watched.streamer.setBudget(HUGE);
  await watched.until((s) => s.isSettled && s.missingPages === 0 && s.scale === 1);
  expect(watched.last.triangles).toBe(before.triangles);
});

test("counts a damaged page and stays coarse there", async () => {
  const bad = FILE.slice();
  const view = cameraView(NEAR, 0.8, 900, 1);
  const cut = select(PLANET, view);
  const finest = cut[40];
  const page = DAG.page[DAG.slotOf(GROUP_OF[finest]) as number];
  bad[HEADER.pages.offset[page] + 40] ^= 1;
  const watched = await Watched.open(new MemorySource(bad), HUGE);
  watched.streamer.setViews(viewsOf(view));
  await watched.until((s) => s.damagedPages === 1 && s.isSettled);
  expect(watched.problems).toEqual([]);
  expect(watched.last.triangles).toBeGreaterThan(5000);
  expect(watched.cut).not.toContain(finest);
});

describe("an asset with a long table of pages", () => {
  const PAGED = loadAsset("paged");
  const { headerBytes, openingBytes } = PAGED.header.fixed;
  const view = cameraView([0.4, 0.2, 1.25], 0.5, 800, 1);
  const expectedCut = select(PAGED, view);

  test("is opened without that table, and its slices are read once each", async () => {
    expect(openingBytes).toBeGreaterThan(0);
    const source = new MemorySource(PAGED.file);
    const watched = await Watched.open(source, HUGE, PAGED);
    const opened = source.fetched;
    expect(opened).toBe(96 << 10);
    expect(opened).toBeLessThan(headerBytes);
    watched.streamer.setViews(viewsOf(view));
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    expect(watched.cut).toEqual(expectedCut);
    expect(watched.problems).toEqual([]);
    const slices = source.reads.filter(
      ([begin]) => begin >= openingBytes && begin < headerBytes,
    ).length;
    expect(slices).toBeGreaterThan(1);
    expect(slices).toBeLessThanOrEqual(Math.ceil(PAGED.header.pages.count / 4096));
  });

  test("stays coarse where a slice is damaged, and says how many pages are missing", async () => {
    const bad = PAGED.file.slice();
    const { offset, stride } = PAGED.header.pages.section;
    bad[offset + stride * 5000] ^= 1;
    const watched = await Watched.open(new MemorySource(bad), HUGE, PAGED);
    watched.streamer.setViews(viewsOf(view));
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    expect(watched.last.damagedPages).toBeGreaterThan(0);
    expect(watched.problems).toEqual([]);
    expect(watched.cut.length).toBeGreaterThan(100);
    expect(watched.cut.length).toBeLessThan(expectedCut.length);
  });

  test("is refused where what precedes the table is damaged", async () => {
    const bad = PAGED.file.slice();
    bad[openingBytes - 100] ^= 1;
    await expect(Watched.open(new MemorySource(bad), HUGE, PAGED)).rejects.toThrow("checksum");
  });

  test("needs few requests: pages that lie near each other share one", async () => {
    const source = new MemorySource(PAGED.file);
    const watched = await Watched.open(source, HUGE, PAGED);
    watched.streamer.setViews(viewsOf(view));
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    const pages = watched.pages.size;
    expect(pages).toBeGreaterThan(300);
    expect(source.requests).toBeLessThan(pages / 8);
    expect(source.fetched).toBeLessThan(2 * watched.last.wantedFileBytes + headerBytes);
  });

  test("tells of those pages only whose state has changed", async () => {
    const watched = await Watched.open(new MemorySource(PAGED.file), HUGE, PAGED);
    watched.streamer.setViews(viewsOf(view));
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    const told = watched.updates.reduce((sum, { pages }) => sum + pages.length / 2, 0);
    // Each page is loading, then resident.
    expect(told).toBeLessThanOrEqual(2 * watched.pages.size);
    expect(new Set(watched.pages.values())).toEqual(new Set([RESIDENT]));
  });
});

describe("an asset with a tree of instances", () => {
  const FOREST = loadAsset("forest");
  const view = cameraView([400, 3, 400], 0.8, 600, 2);
  // A view volume to the right, of 90 degrees.
  const planes = Float32Array.from([0.7, 0, 0.7, -560, 0.7, 0, -0.7, 0]);

  test("shows the listed stand-ins first, then what the view needs", async () => {
    const watched = await Watched.open(new MemorySource(FOREST.file), HUGE, FOREST);
    watched.streamer.setScene({ view, planes });
    await watched.until((s) => s.triangles > 0);
    const [first] = watched.updates.filter(({ rows }) => rows);
    expect(first.rows?.reduce((sum, { count }) => sum + count, 0)).toBe(
      FOREST.header.instances.length,
    );
    await watched.until((s) => s.isSettled && s.instances > 0);
    const { rows } = watched.updates.filter((update) => update.rows).at(-1) as StreamUpdate;
    const shown = rows?.reduce((sum, { count }) => sum + count, 0);
    expect(shown).toBe(watched.last.shownInstances);
    expect(shown).toBeGreaterThan(2 * FOREST.header.instances.length);
    expect(watched.last.instances).toBe(70_001);
    expect(watched.problems).toEqual([]);
    // Some stand so near that they have views of their own.
    expect(rows?.some(({ isOwn }) => isOwn)).toBe(true);
    expect(watched.last.missingPages).toBe(0);
  });

  test("tells of rows only when they change, and turns with the camera", async () => {
    const watched = await Watched.open(new MemorySource(FOREST.file), HUGE, FOREST);
    watched.streamer.setScene({ view, planes });
    await watched.until((s) => s.isSettled && s.instances > 0);
    const count = () => watched.updates.filter(({ rows }) => rows).length;
    const before = count();
    watched.streamer.setScene({ view, planes });
    await new Promise((next) => setTimeout(next, 150));
    expect(count()).toBe(before);
    watched.streamer.setScene({ view, planes: planes.map((x) => -x) });
    await new Promise((next) => setTimeout(next, 50));
    await watched.until((s) => s.isSettled);
    expect(count()).toBeGreaterThan(before);
  });

  test.each<View>([view, { kind: "error", error: 0.01 }])(
    "shows less outside of the picture of a view by $kind",
    async (each) => {
      const shownOf = async (seen: View) => {
        const watched = await Watched.open(new MemorySource(FOREST.file), HUGE, FOREST);
        watched.streamer.setScene({ view: seen, planes: new Float32Array(0) });
        await watched.until((s) => s.isSettled && s.instances > 0);
        return watched.last.shownInstances;
      };
      const fewer = await shownOf({ ...each, planes, offscreen: 1e6 } as View);
      expect(fewer).toBeLessThan(0.9 * (await shownOf(each)));
    },
  );

  test("shows less within a small budget", async () => {
    const watched = await Watched.open(new MemorySource(FOREST.file), 4_000_000, FOREST);
    watched.streamer.setScene({ view, planes });
    await watched.until((s) => s.instances > 0 && s.missingPages === 0 && s.isSettled);
    expect(watched.problems).toEqual([]);
    expect(watched.last.scale).toBeGreaterThan(1);
    expect(watched.last.shownInstances).toBeLessThan(4_000_000 / 8 / 128);
    expect(watched.last.residentBytes).toBeLessThanOrEqual(4_000_000);
  });

  test("shows no more than the budget allows where no error is allowed", async () => {
    const watched = await Watched.open(new MemorySource(FOREST.file), 4_000_000, FOREST);
    watched.streamer.setScene({ view: { ...view, threshold: 0 }, planes });
    await watched.until((s) => s.instances > 0 && s.missingPages === 0 && s.isSettled);
    expect(watched.problems).toEqual([]);
    expect(watched.last.shownInstances).toBeLessThan(4_000_000 / 8 / 128);
    expect(watched.last.shownInstances).toBeGreaterThan(100);
  });

  test("keeps the stand-ins where its nodes are damaged", async () => {
    const bad = FOREST.file.slice();
    bad[(FOREST.header.tree?.nodes.offset as number) + 70] ^= 1;
    const watched = await Watched.open(new MemorySource(bad), HUGE, FOREST);
    watched.streamer.setScene({ view, planes });
    await watched.until((s) => s.damagedPages === 1 && s.isSettled);
    const { rows } = watched.updates.filter((update) => update.rows).at(-1) as StreamUpdate;
    expect(rows?.reduce((sum, { count }) => sum + count, 0)).toBe(FOREST.header.instances.length);
    expect(watched.last.triangles).toBeGreaterThan(0);
  });
});

test("a paused stream requests nothing, and goes on where it was", async () => {
  const source = new MemorySource(FILE);
  const watched = await Watched.open(source, HUGE);
  const view = cameraView(NEAR, 0.8, 800, 2);
  watched.streamer.setViews(viewsOf(view));
  await watched.until((s) => s.triangles > 0);
  watched.streamer.setPaused(true);
  await new Promise((next) => setTimeout(next, 50));
  const { requests } = source;
  await new Promise((next) => setTimeout(next, 50));
  expect(source.requests).toBe(requests);
  expect(watched.last.isSettled).toBe(false);
  watched.streamer.setPaused(false);
  await watched.until((s) => s.isSettled && s.missingPages === 0);
  expect(watched.cut).toEqual(select(PLANET, view));
});

test.each(["planet", "forest"])("does not press a server that refuses %s", async (name) => {
  const asset = loadAsset(name);
  const source = new MemorySource(asset.file);
  const watched = await Watched.open(source, HUGE, asset);
  source.isRefusing = true;
  const view = cameraView(NEAR, 0.8, 800, 2);
  if (asset.header.tree) watched.streamer.setScene({ view, planes: new Float32Array(0) });
  else watched.streamer.setViews(viewsOf(view));
  for (let frame = 0; frame < 30; ++frame) {
    await new Promise((next) => setTimeout(next, 10));
    watched.streamer.setBudget(HUGE);
  }
  // As many as are open at the same time.
  expect(source.requests).toBeGreaterThan(1);
  expect(source.requests).toBeLessThanOrEqual(1 + 6);
});

test("reports that memory is short, and goes on without what finds none", async () => {
  const watched = await Watched.open(new MemorySource(FILE), HUGE);
  let isShort = false;
  vi.stubGlobal(
    "Int32Array",
    new Proxy(Int32Array, {
      construct: (type, [size, ...rest]) => {
        if (isShort && size > 5000) throw new RangeError("Array buffer allocation failed");
        return Reflect.construct(type, [size, ...rest]);
      },
    }),
  );
  try {
    const view = cameraView(NEAR, 0.8, 800, 2);
    watched.streamer.setViews(viewsOf(view));
    await watched.until((s) => s.triangles > 0);
    isShort = true;
    await watched.until(() => watched.problems.length > 0);
    isShort = false;
    expect(new Set(watched.problems)).toEqual(
      new Set(["The browser has no memory left for the asset. A smaller budget may help."]),
    );
    expect(watched.last.damagedPages).toBe(0);
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    expect(watched.cut).toEqual(select(PLANET, view));
  } finally {
    vi.unstubAllGlobals();
  }
}, 15_000);

test("embedded files of an asset that is gone may be asked for again", async () => {
  const asset = loadAsset("materials");
  const source = new MemorySource(asset.file);
  const { streamer } = await Watched.open(source, HUGE, asset);
  source.isRefusing = true;
  await expect(streamer.readFile(0)).rejects.toMatchObject({ kind: "network" });
  source.isRefusing = false;
  expect((await streamer.readFile(0)).length).toBe(asset.header.files[0]?.size);
});
