// Streams an asset: fetches and decodes the pages that the views need, and hands over groups for the
// GPU with the clusters to draw. It runs in a worker, but does not depend on one.

import { readPage } from "../decode/page.js";
import { checkNumber, memoryError, UmbelError } from "../errors.js";
import { type FileHeader, openingBytesOf, readFileHeader } from "../format/file_header.js";
import { placeOf, readSlice } from "../format/page_table.js";
import { FIXED_HEADER_SIZE, readFixedHeader } from "../format/sections.js";
import type { MeshEntry } from "../format/tables.js";
import { memoryOf, packGroup, type RenderGroup } from "../pack/render_group.js";
import { FileQueue } from "../source/file_queue.js";
import type { ByteSource } from "../source/source.js";
import { SpareBytes } from "../source/spare_bytes.js";
import { type AssetInfo, assetInfoOf } from "./asset_info.js";
import { type DrawnCut, drawnCut } from "./drawn_cut.js";
import type { InstanceRow } from "./instance_rows.js";
import { InstanceStream, type SceneView } from "./instance_stream.js";
import { ABSENT } from "./page_cache.js";
import { Residency } from "./residency.js";
import type { StreamListener, StreamOptions } from "./stream_update.js";
import type { MeshView } from "./target_cut.js";

/** Bytes of the first request: for most assets the file header and the coarsest page. */
const FIRST_BYTES = 3 << 15;
/** Bytes after a larger file header that the second request reads, for a first picture. */
const FIRST_PAGES = 1 << 14;
/** Requests for pages and files together: as many as browsers have connections to a host. */
const MAX_REQUESTS = 6;
const MAX_REQUEST_BYTES = 1 << 19;
/** Bytes between two pages that one request may skip. */
const GAP = 1 << 17;
/** Milliseconds between two selections from a tree of instances. */
const TREE_INTERVAL = 60;
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
  private isPaused = false;
  /** Whether nothing is requested until it is time to try again. */
  private isWaiting = false;
  private readonly spare = new SpareBytes();
  /** Of an asset with a tree of instances. */
  private readonly tree: InstanceStream | undefined;
  private rows: InstanceRow[] | undefined;
  private rowCounts: number[] = [];
  private rowsHash: number | undefined;
  private treeTime = 0;
  private needsTree = false;
  private revision = 0;
  private readonly openSlices = new Set<number>();
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
    if (header.tree)
      this.tree = new InstanceStream(
        header,
        budget,
        (begin, length) => this.read(begin, length),
        this.spare,
        (failure) => {
          this.needsTree = true;
          if (failure) this.failed(failure);
          else this.schedule(true);
        },
      );
  }

  /** Of an asset with a tree of instances: selects from it, in place of views of the listed ones. */
  setScene(scene: SceneView): void {
    ++this.revision;
    this.tree?.setView(scene);
    this.needsTree = this.tree !== undefined;
    this.schedule(true);
  }

  static async open(
    source: ByteSource,
    options: StreamOptions,
    listener: StreamListener,
  ): Promise<Streamer> {
    checkNumber("budget", options.budget, true);
    let bytes = await source.read(0, FIRST_BYTES);
    const fixed = readFixedHeader(bytes.length < FIXED_HEADER_SIZE ? bytes.slice() : bytes);
    const needed = openingBytesOf(fixed);
    if (bytes.length < needed) {
      const end = needed < fixed.headerBytes ? needed : needed + FIRST_PAGES;
      const rest = await source.read(bytes.length, Math.min(end, fixed.fileBytes) - bytes.length);
      bytes = joined(bytes, rest);
    }
    return new Streamer(source, readFileHeader(bytes), bytes, options.budget, listener);
  }

  /** While paused, nothing more is requested: the receiver has enough to do. */
  setPaused(isPaused: boolean): void {
    this.isPaused = isPaused;
    if (!isPaused) this.schedule();
  }

  close(): void {
    this.isClosed = true;
    this.source.close();
  }

  setViews(views: readonly MeshView[]): void {
    ++this.revision;
    this.residency.setViews(views);
    this.schedule(true);
  }

  setBudget(bytes: number): void {
    checkNumber("budget", bytes, true);
    ++this.revision;
    this.budget = bytes;
    this.tree?.setBudget(bytes);
    this.needsTree = this.tree !== undefined;
    this.residency.setBudget(bytes - (this.tree?.bytes ?? 0));
    this.schedule(true);
  }

  /** Reads an embedded file; geometry comes before files that are not urgent. */
  async readFile(index: number, isUrgent = false): Promise<Uint8Array> {
    const file = this.header.files[index];
    if (!file) throw new UmbelError("corrupt", `The file has no embedded file ${index}.`);
    try {
      return await this.files.read(file, isUrgent);
    } catch (error) {
      // The asset was there: it may be back later, as after a lost connection.
      const isGone = error instanceof UmbelError && /missing|refused/.test(error.kind);
      throw isGone ? new UmbelError("network", error.message) : error;
    }
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

  /** Selects from the tree of instances; not too often, since what is shown is sent as a whole. */
  private selectInstances(tree: InstanceStream): void {
    if (!this.needsTree || !tree.hasView) return;
    const wait = this.treeTime + TREE_INTERVAL - performance.now();
    if (wait > 0) {
      setTimeout(() => this.schedule(true), wait);
      return;
    }
    this.needsTree = false;
    this.needsPlan = true;
    const { rows, views, hash } = tree.select();
    this.residency.setViews(views);
    this.residency.setRest(this.budget - tree.bytes);
    this.rowCounts = rows.map(({ count }) => count);
    if (hash !== this.rowsHash) {
      this.rows = rows;
      this.cutChanged = true;
    }
    this.rowsHash = hash;
    this.treeTime = performance.now();
  }

  private step(): void {
    const start = performance.now();
    if (this.tree) this.selectInstances(this.tree);
    if (this.residency.viewCount === 0) return;
    if (this.needsPlan) {
      this.needsPlan = false;
      if (this.residency.plan()) this.cutChanged = true;
      this.selectTime = performance.now() - start;
      this.removeGroups(this.residency.trim());
    }
    if (!this.isPaused && !this.isWaiting) this.fetchMore();
    this.emit();
  }

  private fetchMore(): void {
    const limit = MAX_REQUESTS - this.files.requests;
    // Pages of placements come first: they tell which meshes are needed how fine.
    if (this.tree?.hasView) this.tree.fetchMore(Math.max(limit - 2, 1));
    this.fetchPages(limit - (this.tree?.requests ?? 0));
    if (this.requests > 0 || !this.residency.hasAbsentPages) return;
    if (!this.residency.unblock()) return;
    this.cutChanged = true;
    this.schedule(true);
  }

  private fetchPages(limit: number): void {
    for (const slice of this.residency.missingSlices()) {
      if (this.requests >= limit) return;
      if (!this.openSlices.has(slice)) void this.fetchSlice(slice);
    }
    while (this.requests < limit) {
      const next = this.residency.next();
      if (!next) return;
      this.removeGroups(next.evicted);
      const { offset, size } = this.header.pages;
      const spare = this.spare.take(offset[next.page], size[next.page]);
      if (spare) {
        this.addPage(next.page, spare);
        this.schedule(true);
      } else void this.fetch(this.requestFor(next.page));
    }
  }

  /** The page, with those near it in the file that are to be fetched too: one request. */
  private requestFor(page: number): number[] {
    const { offset, size, count } = this.header.pages;
    const run = [page];
    let begin = offset[page];
    let end = begin + size[page];
    for (let next = page + 1; next < count && offset[next] - end <= GAP; ++next) {
      const newEnd = offset[next] + size[next];
      // Rows of the table that are not read are zero.
      if (newEnd <= end || newEnd - begin > MAX_REQUEST_BYTES) break;
      if (this.spare.has(offset[next]) || !this.residency.takeAlso(next)) continue;
      run.push(next);
      end = newEnd;
    }
    for (let next = page - 1; next >= 0 && begin - offset[next] - size[next] <= GAP; --next) {
      if (size[next] === 0 || offset[next] > begin || end - offset[next] > MAX_REQUEST_BYTES) break;
      if (this.spare.has(offset[next]) || !this.residency.takeAlso(next)) continue;
      run.unshift(next);
      begin = offset[next];
    }
    return run;
  }

  /** Offset and size of absent pages that a request reads beside those that are wanted. */
  private skippedBy(run: readonly number[]): [number, number][] {
    const { offset, size } = this.header.pages;
    const wanted = new Set(run);
    const skipped: [number, number][] = [];
    for (let page = run[0] + 1; page < run[run.length - 1]; ++page)
      if (!wanted.has(page) && this.residency.state[page] === ABSENT)
        skipped.push([offset[page], size[page]]);
    return skipped;
  }

  private async fetchSlice(slice: number): Promise<void> {
    const { pages, fixed } = this.header;
    this.openSlices.add(slice);
    ++this.requests;
    try {
      const bytes = await this.read(...placeOf(pages, slice));
      if (this.isClosed) return;
      readSlice(pages, slice, bytes, fixed);
    } catch (error) {
      if (this.isClosed) return;
      if (!(error instanceof UmbelError)) throw error;
      if (error.kind === "corrupt") this.damagedPages += this.residency.failedSlice(slice);
      else this.failed(error);
    } finally {
      --this.requests;
      this.openSlices.delete(slice);
    }
    this.schedule(true);
  }

  /** Reports that something did not arrive, and requests nothing for a while. */
  private failed(error: UmbelError): void {
    if (error.kind === "memory") this.listener.failed(error);
    else this.listener.connection(true);
    if (this.isWaiting) return;
    this.isWaiting = true;
    setTimeout(() => {
      this.isWaiting = false;
      this.schedule(true);
    }, RETRY_DELAY);
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
      this.spare.keep(begin, bytes, this.skippedBy(run));
      for (const page of run)
        this.addPage(page, bytes.subarray(offset[page] - begin, offset[page] - begin + size[page]));
    } catch (error) {
      if (this.isClosed) return;
      if (!(error instanceof UmbelError)) throw error;
      for (const page of run) this.residency.failed(page, false);
      this.failed(error);
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
      this.added.push(...groups.map((group) => packGroup(group, this.residency.dag)));
    } catch (error) {
      const noMemory = memoryError(error);
      if (!noMemory && !(error instanceof UmbelError)) throw error;
      this.residency.failed(page, !noMemory);
      if (noMemory) this.failed(noMemory);
      else ++this.damagedPages;
    }
  }

  private removeGroups(pages: readonly number[]): void {
    if (pages.length === 0) return;
    const groups = new Set(pages.flatMap((page) => this.residency.dag.groupsOf(page)));
    this.removed.push(...groups);
    this.added = this.added.filter(({ group }) => !groups.has(group));
  }

  private emit(): void {
    const cuts = this.cutChanged ? this.cuts() : undefined;
    const { residency, tree } = this;
    const missingOfTree = tree?.hasView ? tree.missing : 0;
    this.listener.update({
      added: this.added,
      removed: this.removed,
      cuts: cuts?.map(({ runs }) => runs),
      rows: this.rows,
      statistics: {
        ...this.counts(cuts),
        residentBytes: residency.bytes + (tree?.bytes ?? 0),
        wantedBytes: residency.wanted.bytes,
        budget: this.budget,
        fetchedBytes: this.source.fetched,
        wantedFileBytes: residency.wanted.fileBytes,
        missingPages: residency.wanted.missing + missingOfTree,
        damagedPages: this.damagedPages + (tree?.damaged ?? 0),
        scale: Math.max(residency.scale, tree?.scale ?? 1),
        isSettled: residency.isSettled && missingOfTree === 0 && !this.needsTree,
        revision: this.revision,
        shownInstances: tree?.shown ?? 0,
        instances: tree?.total ?? 0,
        selectTime: this.selectTime,
      },
      pages: residency.takeChanges(),
    });
    this.added = [];
    this.removed = [];
    this.rows = undefined;
    this.cutChanged = false;
  }

  private counts(cuts: DrawnCut[] | undefined): { triangles: number; clusters: number } {
    if (cuts) {
      this.lastCounts = { triangles: 0, clusters: 0 };
      cuts.forEach(({ triangles, clusters }, i) => {
        this.lastCounts.triangles += triangles * (this.rowCounts[i] ?? 1);
        this.lastCounts.clusters += clusters * (this.rowCounts[i] ?? 1);
      });
    }
    return this.lastCounts;
  }

  private cuts(): DrawnCut[] {
    const { residency } = this;
    return Array.from({ length: residency.viewCount }, (_, view) =>
      drawnCut(residency.dag, residency.refined(view), (slot) => residency.isPending(view, slot)),
    );
  }
}

function joined(first: Uint8Array, second: Uint8Array): Uint8Array {
  const all = new Uint8Array(first.length + second.length);
  all.set(first);
  all.set(second, first.length);
  return all;
}
