// Holds the state and the memory of each page, and evicts the least recently used pages where the
// budget is exceeded. Pages that are drawn, or that hold roots, stay.
//
// Arrays have an element a page, but only those of pages that were wanted once are ever touched; the
// system gives memory to no others.

import type { GroupInfo } from "../decode/group.js";
import type { FileHeader } from "../format/file_header.js";
import type { GroupDag } from "../select/group_dag.js";

export const ABSENT = 0;
export const LOADING = 1;
export const RESIDENT = 2;
export const DAMAGED = 3;

/** Estimated bytes of memory for each byte of the file, until the first page is read. */
const FIRST_GROWTH = 10;

export class PageCache {
  readonly state: Uint8Array;
  /** For each page: 1 if it holds roots. Without them nothing can be drawn, so they stay. */
  readonly isPinned: Uint8Array;
  /** Memory of resident and loading pages. */
  bytes = 0;
  /** Memory of each page; an estimate until the page is read. */
  private readonly pageBytes: Float64Array;
  private growth = FIRST_GROWTH;
  private readBytes = 0;
  private readFileBytes = 0;
  private readonly lastUse: Float64Array;
  private tick = 0;
  private readonly resident = new Set<number>();
  /** Pages whose state has changed since `takeChanges`. */
  private readonly changed = new Set<number>();

  /**
   * @param memoryOf bytes that a group takes
   * @param drawnPages the pages that are drawn
   */
  constructor(
    private readonly header: FileHeader,
    private readonly dag: GroupDag,
    public budget: number,
    private readonly memoryOf: (info: GroupInfo) => number,
    private readonly drawnPages: () => Set<number>,
  ) {
    const { count } = header.pages;
    this.state = new Uint8Array(count);
    this.pageBytes = new Float64Array(count);
    this.lastUse = new Float64Array(count);
    this.isPinned = new Uint8Array(count);
    for (const { roots } of header.meshes) for (const { page } of roots) this.isPinned[page] = 1;
  }

  /** Bytes of a page in the file; an estimate until its row of the table is read. */
  sizeOf(page: number): number {
    const { pages, fixed } = this.header;
    return pages.size[page] || (fixed.fileBytes - fixed.headerBytes) / pages.count;
  }

  memoryOfPage(page: number): number {
    return this.dag.slotsOfPage.has(page)
      ? (this.pageBytes[page] as number)
      : this.sizeOf(page) * this.growth;
  }

  memoryOfPages(pages: Iterable<number>): number {
    let bytes = 0;
    for (const page of pages) bytes += this.memoryOfPage(page);
    return bytes;
  }

  /** Pages and their states, two numbers each, that have changed since the last call. */
  takeChanges(): Uint32Array {
    const changes = Uint32Array.from([...this.changed].flatMap((page) => [page, this.state[page]]));
    this.changed.clear();
    return changes;
  }

  private setState(page: number, state: number): void {
    this.state[page] = state;
    this.changed.add(page);
    if (state === RESIDENT) this.resident.add(page);
    else this.resident.delete(page);
    const isResident = Number(state === RESIDENT);
    for (const slot of this.dag.slotsOfPage.get(page) ?? []) this.dag.isResident[slot] = isResident;
  }

  /** Known pages that are not resident and were used before this round, least recently used first. */
  idlePages(): number[] {
    const pages: number[] = [];
    for (const page of this.dag.slotsOfPage.keys())
      if (this.state[page] === ABSENT && this.lastUse[page] !== this.tick) pages.push(page);
    return pages.sort((a, b) => this.lastUse[a] - this.lastUse[b]);
  }

  get residentCount(): number {
    return this.resident.size;
  }

  /** Starts a new round; pages used in it are not evicted before the next one. */
  beginRound(): void {
    ++this.tick;
  }

  use(page: number): void {
    this.lastUse[page] = this.tick;
  }

  /** Whether a page fits without eviction. */
  fits(page: number): boolean {
    return this.bytes + this.memoryOfPage(page) <= this.budget;
  }

  /** Marks a page as loading and reserves its memory. */
  beginLoading(page: number): void {
    this.setState(page, LOADING);
    this.pageBytes[page] = this.memoryOfPage(page);
    this.bytes += this.pageBytes[page];
  }

  /**
   * Takes a loaded page whose groups the DAG knows. Returns the pages evicted for it: the page itself
   * where it does not fit, because the estimate was too low.
   */
  store(page: number, infos: readonly GroupInfo[]): number[] {
    const memory = infos.reduce((sum, info) => sum + this.memoryOf(info), 0);
    this.readBytes += memory;
    this.readFileBytes += this.header.pages.size[page];
    this.growth = this.readBytes / Math.max(this.readFileBytes, 1);
    this.bytes -= this.pageBytes[page];
    this.pageBytes[page] = memory;
    const evicted = this.makeRoom(memory);
    if (!evicted && !this.isPinned[page]) {
      this.setState(page, ABSENT);
      return [page];
    }
    this.bytes += memory;
    this.setState(page, RESIDENT);
    this.use(page);
    return evicted ?? [];
  }

  /** Gives up a page that is loading or has just been stored, for now or for good. */
  fail(page: number, forGood: boolean): void {
    if (this.state[page] === LOADING || this.state[page] === RESIDENT)
      this.bytes -= this.pageBytes[page];
    this.setState(page, forGood ? DAMAGED : ABSENT);
  }

  /** Evicts the least recently used pages until `bytes` fit; undefined if they cannot. */
  makeRoom(bytes: number): number[] | undefined {
    if (this.bytes + bytes <= this.budget) return [];
    const evicted: number[] = [];
    let freed = 0;
    for (const page of this.evictablePages()) {
      if (this.bytes - freed + bytes <= this.budget) break;
      if (this.lastUse[page] === this.tick) break;
      freed += this.pageBytes[page];
      evicted.push(page);
    }
    if (bytes > 0 && this.bytes - freed + bytes > this.budget) return undefined;
    for (const page of evicted) this.setState(page, ABSENT);
    this.bytes -= freed;
    return evicted;
  }

  /** Resident pages that are neither drawn nor pinned, least recently used first. */
  private evictablePages(): number[] {
    const drawn = this.drawnPages();
    const pages: number[] = [];
    for (const page of this.resident)
      if (!drawn.has(page) && !this.isPinned[page]) pages.push(page);
    return pages.sort((a, b) => this.lastUse[a] - this.lastUse[b]);
  }
}
