// Streams an asset: fetches and decodes the pages that the views need, and hands over groups for the
// GPU with the clusters to draw. It runs in a worker, but does not depend on one.

import { readPage } from "../decode/page.js";
import { UmbelError } from "../errors.js";
import { type FileHeader, readFileHeader } from "../format/file_header.js";
import { FIXED_HEADER_SIZE, readFixedHeader } from "../format/sections.js";
import type { MeshEntry } from "../format/tables.js";
import { memoryOf, packGroup, type RenderGroup } from "../pack/render_group.js";
import { FileQueue } from "../source/file_queue.js";
import type { ByteSource } from "../source/source.js";
import { type AssetInfo, assetInfoOf } from "./asset_info.js";
import { type DrawnCut, drawnCut } from "./drawn_cut.js";
import { Residency } from "./residency.js";
import type { StreamListener, StreamOptions } from "./stream_update.js";
import type { MeshView } from "./target_cut.js";

/** Bytes of the first request: for most assets the file header and the coarsest page. */
const FIRST_BYTES = 3 << 15;
/** Bytes after a larger file header that the second request reads, for a first picture. */
const FIRST_PAGES = 1 << 14;
/** Requests for pages and files together: as many as browsers have connections to a host. */
const MAX_REQUESTS = 6;
const MAX_REQUEST_BYTES = 1 << 18;
/** Milliseconds until a failed request is tried again. */
const RETRY_DELAY = 4000;

export class Streamer {
  readonly info: AssetInfo;
  readonly residency: Residency;
  private readonly files: FileQueue;
  private added: RenderGroup[] = [];
  private removed: number[] = [];
  private cutChanged = false;
  private requests = 0;
  private damagedPages = 0;
  private selectTime = 0;
  private isScheduled = false;
  private isClosed = false;
  private needsPlan = false;
  private lastCounts = { triangles: 0, clusters: 0 };

  private constructor(
    private readonly source: ByteSource,
    readonly header: FileHeader,
    /** The bytes that came with the file header, from the start of the file. */
    private readonly prefix: Uint8Array,
    private budget: number,
    private readonly listener: StreamListener,
  ) {
    this.info = assetInfoOf(header);
    this.files = new FileQueue(
      source,
      () => this.residency.wanted.missing > 0,
      () => this.schedule(),
    );
    this.residency = new Residency(header, budget, (info) =>
      memoryOf(info, (header.meshes[info.mesh] as MeshEntry).attributes),
    );
  }

  static async open(
    source: ByteSource,
    options: StreamOptions,
    listener: StreamListener,
  ): Promise<Streamer> {
    let bytes = await source.read(0, FIRST_BYTES);
    const fixed = readFixedHeader(bytes.length < FIXED_HEADER_SIZE ? bytes.slice() : bytes);
    if (bytes.length < fixed.headerBytes) {
      const rest = await source.read(
        bytes.length,
        Math.min(fixed.headerBytes + FIRST_PAGES, fixed.fileBytes) - bytes.length,
      );
      bytes = joined(bytes, rest);
    }
    return new Streamer(source, readFileHeader(bytes), bytes, options.budget, listener);
  }

  close(): void {
    this.isClosed = true;
    this.source.close();
  }

  setViews(views: readonly MeshView[]): void {
    this.residency.setViews(views);
    this.schedule(true);
  }

  setBudget(bytes: number): void {
    this.budget = bytes;
    this.residency.setBudget(bytes);
    this.schedule(true);
  }

  /** Reads an embedded file; geometry comes before files that are not urgent. */
  async readFile(index: number, isUrgent = false): Promise<Uint8Array> {
    const file = this.header.files[index];
    if (!file) throw new UmbelError("corrupt", `The file has no embedded file ${index}.`);
    return this.files.read(file, isUrgent);
  }

  /** Steps once, after all events of this moment. */
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
    if (this.needsPlan) {
      this.needsPlan = false;
      const start = performance.now();
      if (this.residency.plan()) this.cutChanged = true;
      this.selectTime = performance.now() - start;
      this.removeGroups(this.residency.trim());
    }
    this.fetchMore();
    if (this.requests === 0 && this.residency.hasAbsentPages) {
      this.residency.unblock();
      this.cutChanged = true;
      this.schedule(true);
    }
    this.emit();
  }

  private fetchMore(): void {
    while (this.requests < MAX_REQUESTS - this.files.requests) {
      const next = this.residency.next();
      if (!next) return;
      this.removeGroups(next.evicted);
      void this.fetch(this.requestFor(next.page));
    }
  }

  /** The page, with its neighbours in the file that are to be fetched too: one request. */
  private requestFor(page: number): number[] {
    const { offset, size } = this.header.pages;
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
    const { offset, size } = this.header.pages;
    const begin = offset[run[0]];
    const last = run[run.length - 1];
    const length = offset[last] + size[last] - begin;
    ++this.requests;
    try {
      const bytes = await this.read(begin, length);
      if (this.isClosed) return;
      for (const page of run)
        this.addPage(page, bytes.subarray(offset[page] - begin, offset[page] - begin + size[page]));
    } catch (error) {
      if (this.isClosed) return;
      if (!(error instanceof UmbelError)) throw error;
      for (const page of run) this.residency.failed(page, false);
      this.listener.connection(true);
      setTimeout(() => this.schedule(true), RETRY_DELAY);
    } finally {
      --this.requests;
    }
    this.schedule(true);
  }

  /** Reads bytes of the file, or takes them from those that came with the file header. */
  private async read(begin: number, length: number): Promise<Uint8Array> {
    const known = this.prefix.subarray(begin, begin + length);
    if (known.length === length) return known;
    const rest = await this.source.read(begin + known.length, length - known.length);
    return known.length === 0 ? rest : joined(known, rest);
  }

  private addPage(page: number, bytes: Uint8Array): void {
    try {
      const groups = readPage(this.header, page, bytes);
      const evicted = this.residency.arrived(
        page,
        groups.map(({ info }) => info),
      );
      this.removeGroups(evicted.filter((other) => other !== page));
      if (evicted.includes(page)) return;
      for (const group of groups) this.added.push(packGroup(group, this.residency.dag));
    } catch (error) {
      if (!(error instanceof UmbelError)) throw error;
      ++this.damagedPages;
      this.residency.failed(page, true);
    }
  }

  private removeGroups(pages: readonly number[]): void {
    for (const page of pages) {
      const groups = this.residency.dag.groupsOfPage[page] ?? [];
      this.removed.push(...groups);
      this.added = this.added.filter(({ group }) => !groups.includes(group));
    }
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
        damagedPages: this.damagedPages,
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

  private counts(cuts: DrawnCut[] | undefined): { triangles: number; clusters: number } {
    if (cuts) {
      this.lastCounts = { triangles: 0, clusters: 0 };
      for (const { triangles, clusters } of cuts) {
        this.lastCounts.triangles += triangles;
        this.lastCounts.clusters += clusters;
      }
    }
    return this.lastCounts;
  }

  private cuts(): DrawnCut[] {
    const { residency } = this;
    return Array.from({ length: residency.viewCount }, (_, view) =>
      drawnCut(residency.dag, residency.refined(view), (group) => residency.isPending(view, group)),
    );
  }
}

function joined(first: Uint8Array, second: Uint8Array): Uint8Array {
  const all = new Uint8Array(first.length + second.length);
  all.set(first);
  all.set(second, first.length);
  return all;
}
