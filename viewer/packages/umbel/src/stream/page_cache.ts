// Holds the state and the memory of each page, and evicts the least recently used pages where the
// budget is exceeded. Pages that are drawn, or that hold roots, stay.

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
  /** For each group: 1 if its page is resident. */
  readonly isGroupResident: Uint8Array;
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

  /**
   * @param memoryOf bytes that a group takes
   * @param drawnPages for each page 1 if it is drawn
   */
  constructor(
    private readonly header: FileHeader,
    private readonly dag: GroupDag,
    public budget: number,
    private readonly memoryOf: (info: GroupInfo) => number,
    private readonly drawnPages: () => Uint8Array,
  ) {
    const { count } = header.pages;
    this.state = new Uint8Array(count);
    this.pageBytes = new Float64Array(count);
    this.lastUse = new Float64Array(count);
    this.isPinned = new Uint8Array(count);
    this.isGroupResident = new Uint8Array(header.groups);
    for (const { roots } of header.meshes) for (const { page } of roots) this.isPinned[page] = 1;
  }

  memoryOfPage(page: number): number {
    return this.dag.groupsOfPage[page]
      ? (this.pageBytes[page] as number)
      : this.header.pages.size[page] * this.growth;
  }

  memoryOfPages(isIncluded: Uint8Array): number {
    let bytes = 0;
    for (let page = 0; page < isIncluded.length; ++page)
      if (isIncluded[page]) bytes += this.memoryOfPage(page);
    return bytes;
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
    this.state[page] = LOADING;
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
      this.state[page] = ABSENT;
      return [page];
    }
    this.bytes += memory;
    this.state[page] = RESIDENT;
    this.use(page);
    for (const { group } of infos) this.isGroupResident[group] = 1;
    return evicted ?? [];
  }

  /** Gives a loading page up, for now or for good. */
  fail(page: number, forGood: boolean): void {
    this.bytes -= this.pageBytes[page];
    this.state[page] = forGood ? DAMAGED : ABSENT;
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
    for (const page of evicted) {
      this.state[page] = ABSENT;
      for (const group of this.dag.groupsOfPage[page] ?? []) this.isGroupResident[group] = 0;
    }
    this.bytes -= freed;
    return evicted;
  }

  /** Resident pages that are neither drawn nor pinned, least recently used first. */
  private evictablePages(): number[] {
    const isDrawn = this.drawnPages();
    const pages: number[] = [];
    for (let page = 0; page < this.state.length; ++page)
      if (this.state[page] === RESIDENT && !isDrawn[page] && !this.isPinned[page]) pages.push(page);
    return pages.sort((a, b) => this.lastUse[a] - this.lastUse[b]);
  }
}
