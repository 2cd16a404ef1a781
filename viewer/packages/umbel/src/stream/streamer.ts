// Streams an asset: what the views want is fetched, decoded and handed over as groups for the GPU,
// with the list of clusters to draw. Runs in a worker, but needs none.

import { readPage } from "../decode/page.js";
import { UmbelError } from "../errors.js";
import {
  HEADER_SIZE,
  type Head,
  type Instance,
  NONE,
  readHead,
  readHeader,
} from "../format/file_header.js";
import type { Json } from "../format/gltf.js";
import type { Catalog } from "../select/catalog.js";
import { isDrawn } from "../select/refinement.js";
import { FileQueue } from "./file_queue.js";
import { memoryOf, packGroup, type RenderGroup } from "./render_group.js";
import { type MeshView, Residency } from "./residency.js";
import type { ByteSource } from "./source.js";

/** What is asked for first: for most assets the whole head, and the coarsest picture. */
const FIRST_BYTES = 3 << 15;
/** Asked for with the rest of a larger head, so that there is a picture at once. */
const FIRST_PAGES = 1 << 14;
/** Of pages and files together, as browsers have connections to a host. */
const MAX_REQUESTS = 6;
const MAX_REQUEST_BYTES = 1 << 18;
const RETRY_AFTER = 4000;

/** What is in an asset, for whoever shows it. */
export interface AssetInfo {
  fileBytes: number;
  headBytes: number;
  /** Of the full meshes, all together, each once. */
  sourceTriangles: number;
  sourceVertices: number;
  /** The same with every instance counted. */
  instancedTriangles: number;
  levels: number;
  groups: number;
  clusters: number;
  pages: number;
  meshes: MeshInfo[];
  instances: Instance[];
  /** Where the zero of all positions is, in binary64. */
  origin: [number, number, number];
  metadata: Json;
  /** glTF's materials, textures, samplers and images. */
  materials: Json;
  /** glTF's nodes, cameras, skins and what else the scene has. */
  scene: Json;
}

export interface MeshInfo {
  low: [number, number, number];
  high: [number, number, number];
  levels: number;
  attributes: string[];
  /** What else vertices have: "joints", and "unknown" for what is not known here. */
  skipped: string[];
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
  private readonly files: FileQueue;
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
    readonly head: Head,
    private readonly prefix: Uint8Array,
    private budget: number,
    private readonly listener: StreamListener,
  ) {
    this.info = infoOf(head);
    this.files = new FileQueue(
      source,
      () => this.residency.wanted.missing > 0,
      () => this.schedule(),
    );
    this.residency = new Residency(head, budget, (info) =>
      memoryOf(info, (head.meshes[info.mesh] as Head["meshes"][number]).attributes),
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
      bytes = joined(bytes, rest);
    }
    return new Streamer(source, readHead(bytes), bytes, options.budget, listener);
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

  /** The bytes of an embedded file; those that are not urgent make way for geometry. */
  async readFile(index: number, isUrgent = false): Promise<Uint8Array> {
    const file = this.head.files[index];
    if (!file) throw new UmbelError("corrupt", `The file has no embedded file ${index}.`);
    return this.files.read(file, isUrgent);
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
    if (this.needsPlan) {
      this.needsPlan = false;
      const start = performance.now();
      if (this.residency.plan()) this.cutChanged = true;
      this.selectTime = performance.now() - start;
      this.drop(this.residency.trim());
    }
    this.fetchMore();
    if (this.requests === 0 && this.residency.isHungry) {
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
      this.drop(next.evicted);
      void this.fetch(this.run(next.page));
    }
  }

  /** The page with those beside it in the file that are wanted too. */
  private run(page: number): number[] {
    const { offset, size } = this.head.pages;
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
    const { offset, size } = this.head.pages;
    const begin = offset[run[0]];
    const last = run[run.length - 1];
    const length = offset[last] + size[last] - begin;
    ++this.requests;
    try {
      const bytes = await this.read(begin, length);
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
    this.schedule(true);
  }

  /** Bytes of the file; what came with the head is not asked for again. */
  private async read(begin: number, length: number): Promise<Uint8Array> {
    const known = this.prefix.subarray(begin, begin + length);
    if (known.length === length) return known;
    const rest = await this.source.read(begin + known.length, length - known.length);
    return known.length === 0 ? rest : joined(known, rest);
  }

  private take(page: number, bytes: Uint8Array): void {
    try {
      const groups = readPage(this.head, page, bytes);
      const evicted = this.residency.arrived(
        page,
        groups.map(({ info }) => info),
      );
      this.drop(evicted.filter((other) => other !== page));
      if (evicted.includes(page)) return;
      for (const group of groups) this.added.push(packGroup(group, this.residency.catalog));
    } catch (error) {
      if (!(error instanceof UmbelError)) throw error;
      ++this.damaged;
      this.residency.failed(page, true);
    }
  }

  private drop(pages: readonly number[]): void {
    for (const page of pages) {
      const groups = this.residency.catalog.groupsOfPage[page] ?? [];
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
    const { residency } = this;
    return Array.from({ length: residency.viewCount }, (_, view) =>
      cutOf(residency.catalog, residency.refined(view), (group) => residency.waits(view, group)),
    );
  }
}

function joined(first: Uint8Array, second: Uint8Array): Uint8Array {
  const all = new Uint8Array(first.length + second.length);
  all.set(first);
  all.set(second, first.length);
  return all;
}

interface Cut {
  runs: Uint32Array;
  triangles: number;
  clusters: number;
}

function cutOf(catalog: Catalog, refined: Uint8Array, isWaiting: (group: number) => boolean): Cut {
  const runs: number[] = [];
  let triangles = 0;
  let clusters = 0;
  for (let g = 0; g < catalog.count; ++g) {
    const info = catalog.info[g];
    if (!refined[g] || !info || !isDrawn(catalog, refined, g)) continue;
    let last = -1;
    for (let i = 0; i < info.clusterCount; ++i) {
      const generating = info.generating[i];
      if (generating !== NONE && refined[generating]) continue;
      const waits = generating !== NONE && isWaiting(generating) ? 1 : 0;
      const at = runs.length - 3;
      if (last === i - 1 && last >= 0 && runs[at + 2] === waits) ++(runs[at + 1] as number);
      else runs.push(info.firstCluster + i, 1, waits);
      last = i;
      triangles += info.triangleOffsets[i + 1] - info.triangleOffsets[i];
      ++clusters;
    }
  }
  return { runs: Uint32Array.from(runs), triangles, clusters };
}

/** Attributes that nothing is shown of. */
const SKIPPED = new Map([
  [4, "texture coordinates"],
  [16, "joints"],
  [32, "joints"],
]);

function infoOf(head: Head): AssetInfo {
  const { header, meshes, instances, pages } = head;
  const sum = (of: (mesh: Head["meshes"][number]) => number) =>
    meshes.reduce((total, mesh) => total + of(mesh), 0);
  return {
    fileBytes: header.fileBytes,
    headBytes: header.headBytes,
    sourceTriangles: sum((mesh) => mesh.sourceTriangles),
    sourceVertices: sum((mesh) => mesh.sourceVertices),
    instancedTriangles: instances.reduce(
      (total, { mesh }) => total + (meshes[mesh]?.sourceTriangles ?? 0),
      0,
    ),
    levels: meshes.reduce((most, mesh) => Math.max(most, mesh.levels), 0),
    groups: head.groups,
    clusters: head.clusters,
    pages: pages.count,
    meshes: meshes.map(({ low, high, levels, attributes }) => ({
      low: [low[0], low[1], low[2]],
      high: [high[0], high[1], high[2]],
      levels,
      attributes: attributes.flatMap(({ name }) => name ?? []),
      skipped: attributes.flatMap(({ name, kind }) =>
        name ? [] : (SKIPPED.get(kind) ?? "unknown"),
      ),
    })),
    instances,
    origin: head.origin,
    metadata: head.metadata,
    materials: head.materials,
    scene: head.scene,
  };
}
