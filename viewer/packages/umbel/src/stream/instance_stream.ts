// Streams a tree of instances: its nodes, then the pages of placements that the view needs.

import { memoryError, UmbelError } from "../errors.js";
import { type FileHeader, NONE } from "../format/file_header.js";
import { type InstanceTables, readInstanceNodes, readPlacements } from "../format/instance_tree.js";
import type { MeshEntry } from "../format/tables.js";
import {
  InstanceSelector,
  type InstanceStep,
  pageOfInstances,
} from "../select/instance_selector.js";
import type { View } from "../select/select.js";
import type { SpareBytes } from "../source/spare_bytes.js";
import { type InstanceRows, instanceRows } from "./instance_rows.js";

/** Bytes of a request, and bytes between two pages that one request may skip. */
const MAX_REQUEST_BYTES = 1 << 19;
const GAP = 1 << 17;
/** Part of the budget for pages of placements, and for what is shown of them. */
const SHARE = 1 / 8;
/** Bytes of a placement that is shown: its matrix, here and on the GPU. */
const SHOWN_BYTES = 128;
/** Factor on the allowed error where the view shows too many placements, again and again. */
const COARSER = 1.25;
const MAX_SCALE = 2 ** 24;
/** The least error that can be made coarser: of the distance, and of the scene's radius. */
const LEAST = 1e-7;

/** A view of the scene. */
export interface SceneView {
  view: View;
  /** What lies outside them is not shown. */
  planes: Float32Array;
}

export class InstanceStream {
  /** Number of open requests. */
  requests = 0;
  /** Pages that were damaged. */
  damaged = 0;
  /** Factor on the allowed error that the budget demands. */
  scale = 1;
  private selector: InstanceSelector | undefined;
  private scene: SceneView | undefined;
  private step: InstanceStep | undefined;
  private readonly tables: InstanceTables;
  /** Nodes whose pages are requested, and those whose pages are damaged. */
  private readonly busy = new Set<number>();
  private readonly damagedNodes = new Set<number>();
  private isReadingNodes = false;
  private isDamaged = false;

  /**
   * @param read reads bytes of the file
   * @param onChange is called when something has arrived, or with the error of a request
   */
  constructor(
    private readonly header: FileHeader,
    private budget: number,
    private readonly read: (begin: number, length: number) => Promise<Uint8Array>,
    private readonly spare: SpareBytes,
    private readonly onChange: (failure?: UmbelError) => void,
  ) {
    this.tables = header.tree as InstanceTables;
  }

  setBudget(bytes: number): void {
    this.budget = bytes;
    this.selector?.setBudget(SHARE * bytes);
  }

  setView(scene: SceneView): void {
    this.scene = scene;
  }

  get hasView(): boolean {
    return this.scene !== undefined;
  }

  /** Memory of loaded pages and of the nodes, and of what is shown. */
  get bytes(): number {
    const nodes = this.selector ? this.tables.nodes.count * this.tables.nodes.stride : 0;
    return nodes + (this.selector?.bytes ?? 0) + SHOWN_BYTES * (this.step?.shown ?? 0);
  }

  get shown(): number {
    return this.step?.shown ?? 0;
  }

  get total(): number {
    return this.selector?.nodes.instances[0] ?? 0;
  }

  /** Pages that the view needs and that are neither there nor damaged. */
  get missing(): number {
    if (this.isDamaged) return 0;
    if (!this.selector) return 1;
    return this.step?.missing.filter((node) => !this.damagedNodes.has(node)).length ?? 1;
  }

  /** What is shown now: the stand-ins of the root until the nodes are there. */
  select(): InstanceRows {
    const { view, planes } = this.scene as SceneView;
    const { selector } = this;
    if (!selector) return this.selectListed(view);
    const most = (SHARE * this.budget) / SHOWN_BYTES;
    this.scale = Math.max(this.scale / COARSER ** 2, 1);
    const radius = selector.nodes.spheres[3] as number;
    const select = (most?: number) => selector.step(scaled(view, this.scale, radius), planes, most);
    let step = select(most);
    for (; !step && this.scale < MAX_SCALE; step = select(most)) this.scale *= COARSER;
    this.step = step ?? (select() as InstanceStep);
    const coarser = scaled(view, this.scale, radius);
    selector.evict();
    const pageOf = (node: number) => selector.page(node);
    return instanceRows(this.step, pageOf, selector.nodes, this.tables.coarsestErrors, coarser);
  }

  private selectListed(view: View): InstanceRows {
    const page = pageOfInstances(this.header.instances);
    const runs = [{ node: NONE, first: 0, count: page.count, isCoarsest: true }];
    const step = { runs, missing: [], shown: page.count, standIns: page.count };
    return instanceRows(step, () => page, undefined, this.tables.coarsestErrors, view);
  }

  /** Requests what is missing, with at most `limit` requests open. */
  fetchMore(limit: number): void {
    if (!this.selector) {
      if (!this.isReadingNodes && !this.isDamaged && limit > 0) void this.fetchNodes();
      return;
    }
    const wanted =
      this.step?.missing.filter((node) => !this.busy.has(node) && !this.damagedNodes.has(node)) ??
      [];
    const open = new Set(wanted.filter((node) => !this.addSpare(node)));
    if (open.size < wanted.length) this.onChange();
    for (const node of wanted) {
      if (this.requests >= limit) return;
      if (open.has(node)) void this.fetch(this.requestFor(node, open));
    }
  }

  /** Takes a page that an earlier request brought along, if one did. */
  private addSpare(node: number): boolean {
    const { offset, size } = (this.selector as InstanceSelector).nodes;
    const bytes = this.spare.take(offset[node], size[node]);
    if (bytes) this.addPage(node, bytes);
    return bytes !== undefined;
  }

  private async fetchNodes(): Promise<void> {
    const { header, tables } = this;
    const { offset, count, stride } = tables.nodes;
    this.isReadingNodes = true;
    ++this.requests;
    let failure: UmbelError | undefined;
    try {
      const bytes = await this.read(offset, count * stride);
      const nodes = readInstanceNodes(bytes, tables, header.instances.length);
      const meshes = header.meshes.map(({ low, high }: MeshEntry, mesh) => ({
        low,
        high,
        coarsestError: tables.coarsestErrors[mesh] as number,
      }));
      this.selector = new InstanceSelector(nodes, meshes, header.instances, SHARE * this.budget);
    } catch (error) {
      const known = memoryError(error) ?? error;
      if (!(known instanceof UmbelError)) throw error;
      this.isDamaged = known.kind === "corrupt";
      if (this.isDamaged) ++this.damaged;
      else failure = known;
    } finally {
      this.isReadingNodes = false;
      --this.requests;
    }
    this.onChange(failure);
  }

  /** The node's page, with wanted ones near it in the file, by rising offset; they leave `open`. */
  private requestFor(node: number, open: Set<number>): number[] {
    const { offset, size, count } = (this.selector as InstanceSelector).nodes;
    const run = [node];
    open.delete(node);
    let begin = offset[node];
    let end = begin + size[node];
    // Pages lie in the order of their nodes.
    for (let n = node + 1; n < count && offset[n] >= end && offset[n] - end <= GAP; ++n) {
      if (offset[n] + size[n] - begin > MAX_REQUEST_BYTES) break;
      if (!open.delete(n)) continue;
      run.push(n);
      end = offset[n] + size[n];
    }
    for (let n = node - 1; n >= 0 && begin - offset[n] - size[n] <= GAP; --n) {
      if (offset[n] > begin || end - offset[n] > MAX_REQUEST_BYTES) break;
      if (!open.delete(n)) continue;
      run.unshift(n);
      begin = offset[n];
    }
    return run;
  }

  private async fetch(run: number[]): Promise<void> {
    const { nodes } = this.selector as InstanceSelector;
    const { offset, size } = nodes;
    const [first, last] = [run[0], run[run.length - 1]];
    const begin = offset[first];
    for (const node of run) this.busy.add(node);
    ++this.requests;
    let failure: UmbelError | undefined;
    try {
      const bytes = await this.read(begin, offset[last] + size[last] - begin);
      this.spare.keep(begin, bytes, this.skippedBy(run));
      for (const node of run) {
        const at = offset[node] - begin;
        this.addPage(node, bytes.subarray(at, at + size[node]));
      }
    } catch (error) {
      failure = memoryError(error) ?? (error as UmbelError);
      if (!(failure instanceof UmbelError)) throw error;
      for (const node of run) this.busy.delete(node);
    } finally {
      --this.requests;
    }
    this.onChange(failure);
  }

  /** Offset and size of pages that a request reads beside those that are wanted. */
  private skippedBy(run: readonly number[]): [number, number][] {
    const selector = this.selector as InstanceSelector;
    const { offset, size } = selector.nodes;
    const skipped: [number, number][] = [];
    for (let node = run[0] + 1; node < run[run.length - 1]; ++node)
      if (!run.includes(node) && !selector.has(node) && !this.damagedNodes.has(node))
        skipped.push([offset[node], size[node]]);
    return skipped;
  }

  private addPage(node: number, bytes: Uint8Array): void {
    const selector = this.selector as InstanceSelector;
    try {
      selector.add(node, readPlacements(bytes, selector.nodes, node, this.header.meshes.length));
      this.busy.delete(node);
    } catch (error) {
      if (!(error instanceof UmbelError)) throw error;
      ++this.damaged;
      this.damagedNodes.add(node);
      this.busy.delete(node);
    }
  }
}

/** @param radius of the scene */
function scaled(view: View, scale: number, radius: number): View {
  // An error of 0 would stay 0.
  const times = (error: number, least: number) =>
    scale === 1 ? error : scale * Math.max(error, least);
  if (view.kind === "camera") return { ...view, threshold: times(view.threshold, LEAST) };
  return view.kind === "error" ? { ...view, error: times(view.error, LEAST * radius) } : view;
}
