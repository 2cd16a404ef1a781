// What a stream tells the page.

import type { UmbelError } from "../errors.js";
import type { RenderGroup } from "../pack/render_group.js";
import type { InstanceRow } from "./instance_rows.js";

export interface StreamStatistics {
  /** Of the drawn cuts. */
  triangles: number;
  clusters: number;
  /** Memory of resident and loading pages, and of the pages of the selected cuts. */
  residentBytes: number;
  wantedBytes: number;
  budget: number;
  /** Bytes received so far, file header included; and file bytes of the selected cuts' pages. */
  fetchedBytes: number;
  wantedFileBytes: number;
  missingPages: number;
  damagedPages: number;
  /** Factor on the allowed error that the budget demands; 1 if it suffices. */
  scale: number;
  /** Whether the selected cuts are drawn. */
  isSettled: boolean;
  /** Number of views and budgets that the stream was given so far: these counts are of the last. */
  revision: number;
  /** Placements that a tree of instances shows, and its instances; 0 without one. */
  shownInstances: number;
  instances: number;
  /** Time of the last selection, in milliseconds. */
  selectTime: number;
}

export interface StreamUpdate {
  added: RenderGroup[];
  /** Groups to free. */
  removed: number[];
  /**
   * For each view the runs of clusters to draw; undefined where no cut has changed. A run is a first
   * cluster, a number of clusters (of one group), and 1 if finer clusters are still to arrive.
   */
  cuts: Uint32Array[] | undefined;
  /**
   * Of an asset with a tree of instances: what each cut is of, from now on; undefined where that has
   * not changed. With it there are cuts.
   */
  rows?: InstanceRow[] | undefined;
  statistics: StreamStatistics;
  /** Pages whose state has changed, two numbers each: page and state (absent, loading, resident, damaged). */
  pages: Uint32Array;
}

export interface StreamListener {
  update(update: StreamUpdate): void;
  /** The connection was lost, or is back. */
  connection(isLost: boolean): void;
  /** Something failed that leaves parts coarse, at least for now: memory, mostly. */
  failed(error: UmbelError): void;
}

export interface StreamOptions {
  /** Bytes of memory for geometry. */
  budget: number;
}
