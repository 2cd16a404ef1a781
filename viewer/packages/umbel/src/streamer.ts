// Streams an asset: what the views want is fetched, decoded and handed over as groups for the GPU,
// with the list of clusters to draw. Runs in a worker, but needs none.

import { UmbelError } from "./errors.js";
import { BYTES_PER_TRIANGLE, bytesPerVertex, packGroup, type RenderGroup } from "./pack.js";
import { readPage } from "./page.js";
import { isDrawn } from "./refinement.js";
import { groupsOf, Residency } from "./residency.js";
import type { View } from "./select.js";
import type { ByteSource } from "./source.js";
import { HEADER_SIZE, NONE, readHeader, readTables, type Tables } from "./tables.js";

/** What is asked for first: for most assets all tables, and some of the picture. */
const FIRST_BYTES = 1 << 16;
/** Asked for with the rest of the tables, so that there is a picture at once. */
const FIRST_PAGES = 1 << 15;
const MAX_REQUESTS = 6;
const MAX_REQUEST_BYTES = 1 << 18;
const RETRY_AFTER = 4000;

/** What is in an asset, for whoever shows it. */
export interface AssetInfo {
  fileBytes: number;
  headBytes: number;
  sourceTriangles: number;
  sourceVertices: number;
  levels: number;
  groups: number;
  clusters: number;
  pages: number;
  low: [number, number, number];
  high: [number, number, number];
  /** The greatest error that is not infinite. */
  coarsestError: number;
  attributes: string[];
  metadata: Record<string, unknown>;
}

export interface StreamStatistics {
  /** Of the cuts that are drawn. */
  triangles: number;
  clusters: number;
  /** Memory of the pages that are here or on their way, and of those that are wanted. */
  residentBytes: number;
  wantedBytes: number;
  budget: number;
  /** Over the line so far, tables included; and what the wanted pages have in the file. */
  fetchedBytes: number;
  wantedFileBytes: number;
  missingPages: number;
  damagedPages: number;
  /** How many times the wanted error is allowed, to meet the budget. */
  scale: number;
  /** Whether what is drawn is what is wanted. */
  isSettled: boolean;
  /** Milliseconds of the last selection. */
  selectTime: number;
}

export interface StreamUpdate {
  added: RenderGroup[];
  /** Groups whose memory is to be freed. */
  removed: number[];
  /**
   * For each view what to draw, where it has changed: first cluster, number of clusters (of one
   * group), and 1 if something finer is wanted there but not here.
   */
  cuts: Uint32Array[] | undefined;
  statistics: StreamStatistics;
  /** For each page, in the order of the file: absent, loading, resident, damaged. */
  pages: Uint8Array;
}

export interface StreamListener {
  update(update: StreamUpdate): void;
  /** The connection was lost, or is back. */
  connection(isLost: boolean): void;
}

export interface StreamOptions {
  /** Bytes of memory for geometry. */
  budget: number;
}

export class Streamer {
  readonly info: AssetInfo;
  readonly residency: Residency;
  private added: RenderGroup[] = [];
  private removed: number[] = [];
  private cutChanged = false;
  private requests = 0;
  private damaged = 0;
  private selectTime = 0;
  private isScheduled = false;
  private isClosed = false;
  private needsPlan = false;

  private constructor(
    private readonly source: ByteSource,
    readonly tables: Tables,
    private readonly prefix: Uint8Array,
    private budget: number,
    private readonly listener: StreamListener,
  ) {
    this.info = infoOf(tables);
    this.residency = new Residency(
      tables,
      budget,
      bytesPerVertex(tables.attributes),
      BYTES_PER_TRIANGLE,
    );
  }

  static async open(
    source: ByteSource,
    options: StreamOptions,
    listener: StreamListener,
  ): Promise<Streamer> {
    let bytes = await source.read(0, FIRST_BYTES);
    const header = readHeader(bytes.length < HEADER_SIZE ? bytes.slice() : bytes);
    if (bytes.length < header.headBytes) {
      const rest = await source.read(
        bytes.length,
        Math.min(header.headBytes + FIRST_PAGES, header.fileBytes) - bytes.length,
      );
      const all = new Uint8Array(bytes.length + rest.length);
      all.set(bytes);
      all.set(rest, bytes.length);
      bytes = all;
    }
    return new Streamer(source, readTables(bytes), bytes, options.budget, listener);
  }

  close(): void {
    this.isClosed = true;
    this.source.close();
  }

  setViews(views: readonly View[]): void {
    this.residency.setViews(views);
    this.schedule(true);
  }

  setBudget(bytes: number): void {
    this.budget = bytes;
    this.residency.setBudget(bytes);
    this.schedule(true);
  }

  /** Steps once all that happens at the same time has happened. */
  private schedule(plan = false): void {
    this.needsPlan ||= plan;
    if (this.isScheduled || this.isClosed) return;
    this.isScheduled = true;
    setTimeout(() => {
      this.isScheduled = false;
      if (!this.isClosed) this.step();
    }, 0);
  }

  private step(): void {
    if (this.residency.viewCount === 0) return;
    const start = performance.now();
    if (this.needsPlan) {
      this.needsPlan = false;
      this.residency.plan();
      this.selectTime = performance.now() - start;
      this.cutChanged = true;
      this.drop(this.residency.trim());
    } else if (this.residency.settle()) this.cutChanged = true;
    this.fetchMore();
    if (this.requests === 0 && this.residency.isHungry) {
      this.residency.unblock();
      this.cutChanged = true;
      this.schedule(true);
    }
    this.emit();
  }

  private fetchMore(): void {
    while (this.requests < MAX_REQUESTS) {
      const next = this.residency.next();
      if (!next) return;
      this.drop(next.evicted);
      void this.fetch(this.run(next.page));
    }
  }

  /** The page with those beside it in the file that are wanted too. */
  private run(page: number): number[] {
    const { offset, size } = this.tables.pages;
    const run = [page];
    let bytes = size[page];
    const grow = (next: number, end: number) => {
      if (bytes + size[next] > MAX_REQUEST_BYTES || offset[next] + size[next] < end) return false;
      if (!this.residency.takeAlso(next)) return false;
      bytes += size[next];
      return true;
    };
    while (grow(run[run.length - 1] + 1, 0)) run.push(run[run.length - 1] + 1);
    while (grow(run[0] - 1, offset[run[0]])) run.unshift(run[0] - 1);
    return run;
  }

  private async fetch(run: number[]): Promise<void> {
    const { offset, size } = this.tables.pages;
    const begin = offset[run[0]];
    const last = run[run.length - 1];
    const length = offset[last] + size[last] - begin;
    ++this.requests;
    try {
      const bytes =
        begin + length <= this.prefix.length
          ? this.prefix.subarray(begin, begin + length)
          : await this.source.read(begin, length);
      if (this.isClosed) return;
      for (const page of run)
        this.take(page, bytes.subarray(offset[page] - begin, offset[page] - begin + size[page]));
    } catch (error) {
      if (this.isClosed) return;
      if (!(error instanceof UmbelError)) throw error;
      for (const page of run) this.residency.failed(page, false);
      this.listener.connection(true);
      setTimeout(() => this.schedule(true), RETRY_AFTER);
    } finally {
      --this.requests;
    }
    this.schedule();
  }

  private take(page: number, bytes: Uint8Array): void {
    try {
      for (const geometry of readPage(this.tables, page, bytes))
        this.added.push(packGroup(this.tables, geometry));
      this.residency.arrived(page);
    } catch (error) {
      if (!(error instanceof UmbelError)) throw error;
      ++this.damaged;
      this.residency.failed(page, true);
    }
  }

  private drop(pages: readonly number[]): void {
    for (const page of pages) this.removed.push(...groupsOf(this.tables, page));
  }

  private emit(): void {
    const cuts = this.cutChanged ? this.cuts() : undefined;
    const { residency } = this;
    this.listener.update({
      added: this.added,
      removed: this.removed,
      cuts: cuts?.map(({ runs }) => runs),
      statistics: {
        ...this.counts(cuts),
        residentBytes: residency.bytes,
        wantedBytes: residency.wanted.bytes,
        budget: this.budget,
        fetchedBytes: this.source.fetched,
        wantedFileBytes: residency.wanted.fileBytes,
        missingPages: residency.wanted.missing,
        damagedPages: this.damaged,
        scale: residency.scale,
        isSettled: residency.isSettled,
        selectTime: this.selectTime,
      },
      pages: residency.state.slice(),
    });
    this.added = [];
    this.removed = [];
    this.cutChanged = false;
  }

  private lastCounts = { triangles: 0, clusters: 0 };

  private counts(cuts: Cut[] | undefined): { triangles: number; clusters: number } {
    if (cuts) {
      this.lastCounts = { triangles: 0, clusters: 0 };
      for (const { triangles, clusters } of cuts) {
        this.lastCounts.triangles += triangles;
        this.lastCounts.clusters += clusters;
      }
    }
    return this.lastCounts;
  }

  private cuts(): Cut[] {
    return Array.from({ length: this.residency.viewCount }, (_, view) =>
      cutOf(
        this.tables,
        this.residency.refined(view),
        this.residency.target(view),
        (group, refined) => isDrawn(this.residency.dag, refined, group),
      ),
    );
  }
}

interface Cut {
  runs: Uint32Array;
  triangles: number;
  clusters: number;
}

function cutOf(
  { groups, clusters }: Tables,
  refined: Uint8Array,
  target: Uint8Array,
  draws: (group: number, refined: Uint8Array) => boolean,
): Cut {
  const runs: number[] = [];
  let triangles = 0;
  let drawn = 0;
  for (let g = 0; g < groups.count; ++g) {
    if (!refined[g] || !draws(g, refined)) continue;
    const end = groups.firstCluster[g] + groups.clusterCount[g];
    let last = -1;
    for (let c = groups.firstCluster[g]; c < end; ++c) {
      const generating = clusters.generating[c];
      if (generating !== NONE && refined[generating]) continue;
      const waits = generating !== NONE && target[generating] ? 1 : 0;
      const at = runs.length - 3;
      if (last === c - 1 && last >= 0 && runs[at + 2] === waits) ++runs[at + 1];
      else runs.push(c, 1, waits);
      last = c;
      triangles += clusters.triangles[c];
      ++drawn;
    }
  }
  return { runs: Uint32Array.from(runs), triangles, clusters: drawn };
}

function infoOf({
  header,
  levels,
  groups,
  clusters,
  pages,
  attributes,
  metadata,
}: Tables): AssetInfo {
  let coarsestError = 0;
  for (const error of groups.error)
    if (error < Infinity) coarsestError = Math.max(coarsestError, error);
  return {
    fileBytes: header.fileBytes,
    headBytes: header.headBytes,
    sourceTriangles: header.sourceTriangles,
    sourceVertices: header.sourceVertices,
    levels: levels.length,
    groups: groups.count,
    clusters: clusters.count,
    pages: pages.count,
    low: [header.low[0], header.low[1], header.low[2]],
    high: [header.high[0], header.high[1], header.high[2]],
    coarsestError,
    attributes: attributes.map(({ name }) => name),
    metadata,
  };
}
