import { describe, expect, test } from "vitest";
import type { GroupInfo } from "../../../packages/umbel/src/decode/group.js";
import {
  isDrawn,
  keepDrawable,
  nextRefinement,
} from "../../../packages/umbel/src/select/refinement.js";
import { cameraView, type View } from "../../../packages/umbel/src/select/select.js";
import { RESIDENT } from "../../../packages/umbel/src/stream/page_cache.js";
import { Residency } from "../../../packages/umbel/src/stream/residency.js";
import { BlobSource, type ByteSource } from "../../../packages/umbel/src/stream/source.js";
import type {
  StreamStatistics,
  StreamUpdate,
} from "../../../packages/umbel/src/stream/stream_update.js";
import { Streamer } from "../../../packages/umbel/src/stream/streamer.js";
import {
  drawnClusters,
  loadAsset,
  select,
  targetOf as targetOfWhole,
} from "../../support/loaded_asset.js";

const PLANET = loadAsset("planet");
const { file: FILE, head: HEAD, dag: DAG } = PLANET;
const NEAR = [0, 0, 1.3] as const;
const HUGE = 2 ** 30;

function random(seed: number): () => number {
  return () => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed / 2 ** 32;
  };
}

function targetOf(view: View): Uint8Array {
  return targetOfWhole(PLANET, view);
}

/** With a group, everything that it was simplified to. */
function expectClosed(refined: Uint8Array): void {
  for (let g = 0; g < DAG.count; ++g)
    if (refined[g]) for (const above of DAG.coarser[g]) expect(refined[above]).toBe(1);
}

class MemorySource implements ByteSource {
  fetched = 0;
  requests = 0;
  private readonly source: BlobSource;

  constructor(private readonly bytes: Uint8Array) {
    this.source = new BlobSource(new Blob([bytes as Uint8Array<ArrayBuffer>]));
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    ++this.requests;
    const part = await this.source.read(offset, length);
    this.fetched += part.length;
    return part;
  }

  get size(): number {
    return this.bytes.length;
  }

  close(): void {}
}

/** A stream whose updates are kept, and that is waited for. */
class Watched {
  readonly resident = new Set<number>();
  readonly updates: StreamUpdate[] = [];
  cut: number[] = [];
  problems: string[] = [];
  private wake: (() => void) | undefined;
  streamer!: Streamer;

  static async open(source: ByteSource, budget: number): Promise<Watched> {
    const watched = new Watched();
    watched.streamer = await Streamer.open(source, { budget }, watched);
    return watched;
  }

  update(update: StreamUpdate): void {
    for (const group of update.removed) this.resident.delete(group);
    for (const { group } of update.added) this.resident.add(group);
    if (update.cuts) this.cut = this.expand(update.cuts[0]);
    if (update.statistics.residentBytes > update.statistics.budget) this.problems.push("budget");
    this.updates.push({ ...update, added: [] });
    this.wake?.();
  }

  connection(): void {}

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
      const group = GROUP_OF[runs[i]];
      if (!this.resident.has(group)) this.problems.push(`group ${group} is drawn but not here`);
      for (let c = runs[i]; c < runs[i] + runs[i + 1]; ++c) cut.push(c);
    }
    return cut.sort((a, b) => a - b);
  }
}

/** The group of each cluster. */
const GROUP_OF = new Uint32Array(HEAD.clusters);
for (const info of DAG.info)
  if (info) GROUP_OF.fill(info.group, info.firstCluster, info.firstCluster + info.clusterCount);

function infosOf(page: number): GroupInfo[] {
  return (DAG.groupsOfPage[page] ?? []).map((group) => DAG.info[group] as GroupInfo);
}

function seen(view: View): { mesh: number; view: View }[] {
  return [{ mesh: 0, view }];
}

describe("refinement", () => {
  test("with every page here, what is drawn is what is wanted", () => {
    const all = new Uint8Array(DAG.count).fill(1);
    const target = targetOf(cameraView(NEAR, 0.8, 800, 4));
    const before = targetOf(cameraView([0, 3, 0], 0.8, 800, 1));
    expect(nextRefinement(DAG, target, before, all)).toEqual(target);
  });

  test("whatever is here, it is one surface that needs nothing that is not", () => {
    const next = random(5);
    let before = new Uint8Array(DAG.count);
    for (let round = 0; round < 60; ++round) {
      const share = next();
      const here = Uint8Array.from({ length: DAG.count }, (_, g) =>
        // What was drawn stays, as residency sees to.
        Number(
          DAG.error[g] === Infinity ||
            next() < share ||
            (before[g] !== 0 && isDrawn(DAG, before, g)),
        ),
      );
      const eye = [next() * 4 - 2, next() * 4 - 2, next() * 4 - 2] as const;
      const target = targetOf(cameraView(eye, 0.8, 800, 1 + 8 * next()));
      const refined = nextRefinement(DAG, target, before, here);
      expectClosed(refined);
      for (let g = 0; g < DAG.count; ++g)
        if (refined[g] && isDrawn(DAG, refined, g)) expect(here[g]).toBe(1);
      expect(drawnClusters(PLANET, refined).length).toBeGreaterThan(0);
      before = new Uint8Array(refined);
    }
  });

  test("a group between what is here and what is wanted is not needed", () => {
    const target = targetOf({ kind: "error", error: 0 });
    const here = Uint8Array.from({ length: DAG.count }, (_, g) => Number(isDrawn(DAG, target, g)));
    const refined = target.slice();
    keepDrawable(DAG, refined, here);
    expect(refined).toEqual(target);
    expect(here.filter((is) => !is).length).toBeGreaterThan(10);
  });
});

describe("streaming", () => {
  test("ends at the library's cut, with the coarse first and little more than its bytes", async () => {
    const source = new MemorySource(FILE);
    const watched = await Watched.open(source, HUGE);
    const view = cameraView(NEAR, 0.8, 800, 2);
    watched.streamer.setViews(seen(view));
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    expect(watched.cut).toEqual(select(PLANET, view));
    expect(watched.problems).toEqual([]);
    const cuts = watched.updates.filter((u) => u.cuts).map((u) => u.statistics.triangles);
    expect(cuts.find((triangles) => triangles > 0)).toBeLessThan(watched.last.triangles / 8);
    expect(watched.last.fetchedBytes).toBeLessThan(
      1.3 * watched.last.wantedFileBytes + HEAD.fixed.headerBytes,
    );
  });

  test("follows a camera within its budget, without a hole", async () => {
    const budget = 8_000_000;
    const watched = await Watched.open(new MemorySource(FILE), budget);
    for (let i = 0; i < 40; ++i) {
      const angle = i / 4;
      const distance = 1.3 + (i % 10) / 4;
      const eye = [Math.sin(angle) * distance, 0.2, Math.cos(angle) * distance] as const;
      watched.streamer.setViews(seen(cameraView(eye, 0.8, 900, 0.5)));
      const waits = i % 7 === 6 || i === 39;
      await watched.until((s) => !waits || (s.isSettled && s.missingPages === 0));
    }
    expect(watched.problems).toEqual([]);
    expect(watched.updates.some((u) => u.statistics.scale > 1)).toBe(true);
    expect(watched.updates.some((u) => u.removed.length > 0)).toBe(true);
    expect(watched.last.triangles).toBeGreaterThan(20_000);
  });

  test("goes far coarser without fetching what lies between", async () => {
    const watched = await Watched.open(new MemorySource(FILE), HUGE);
    watched.streamer.setViews(seen(cameraView(NEAR, 0.8, 900, 0.5)));
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    const fine = watched.last.fetchedBytes;
    const view = cameraView([0, 0, 9], 0.8, 900, 16);
    watched.streamer.setViews(seen(view));
    await watched.until((s) => s.isSettled && s.missingPages === 0);
    expect(watched.cut).toEqual(select(PLANET, view));
    expect(watched.last.fetchedBytes - fine).toBeLessThan(fine / 4);
    expect(watched.problems).toEqual([]);
  });

  test("a budget that shrinks is kept, and one that grows is used", async () => {
    const watched = await Watched.open(new MemorySource(FILE), HUGE);
    const view = cameraView(NEAR, 0.8, 900, 1);
    watched.streamer.setViews(seen(view));
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

  test("a damaged page stays coarse and is counted", async () => {
    const bad = FILE.slice();
    const view = cameraView(NEAR, 0.8, 900, 1);
    const cut = select(PLANET, view);
    const finest = cut[40];
    const page = DAG.page[GROUP_OF[finest]];
    bad[HEAD.pages.offset[page] + 40] ^= 1;
    const watched = await Watched.open(new MemorySource(bad), HUGE);
    watched.streamer.setViews(seen(view));
    await watched.until((s) => s.damagedPages === 1 && s.isSettled);
    expect(watched.problems).toEqual([]);
    expect(watched.last.triangles).toBeGreaterThan(5000);
    expect(watched.cut).not.toContain(finest);
  });

  test("a thousand cuts keep no more than one", async () => {
    const memory = (info: GroupInfo) =>
      16 * info.vertexOffsets[info.clusterCount] + 12 * info.triangleOffsets[info.clusterCount];
    const residency = new Residency(HEAD, 4_000_000, memory);
    const next = random(9);
    for (let i = 0; i < 1000; ++i) {
      const eye = [next() * 6 - 3, next() * 6 - 3, next() * 6 - 3] as const;
      residency.setViews(seen(cameraView(eye, 0.8, 800, 2)));
      residency.plan();
      for (let n = residency.next(); n; n = residency.next())
        residency.arrived(n.page, infosOf(n.page));
      residency.plan();
      if (residency.hasAbsentPages) residency.unblock();
    }
    let held = 0;
    for (let page = 0; page < residency.state.length; ++page)
      if (residency.state[page] === RESIDENT)
        for (const info of infosOf(page)) held += memory(info);
    expect(held).toBe(residency.bytes);
    expect(residency.bytes).toBeLessThanOrEqual(4_000_000);
  });
});
