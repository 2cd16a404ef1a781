// Progress of loading: a bar at the page's edge, the panel's counters, and performance marks.

import type { UmbelMesh } from "umbel/three";
import type { FrameCounts, Meshes } from "../viewport/viewport";
import { h } from "./dom";

const COUNTER_INTERVAL = 200;

export class Progress {
  readonly element = h("div", { className: "progress" });
  private lastCounters = 0;
  private timer = 0;
  private isMarked = false;

  /** @param showCounts is called a few times a second */
  constructor(private readonly showCounts: (counts: FrameCounts, meshes: Meshes) => void) {}

  begin(): void {
    this.element.classList.remove("done");
    this.element.style.width = "6%";
  }

  end(): void {
    this.element.classList.add("done");
  }

  update(counts: FrameCounts, meshes: Meshes): void {
    const [mesh] = meshes;
    if (mesh?.info.levels === 0) this.end();
    else if (mesh?.statistics) {
      const { wantedBytes, residentBytes, missingPages, triangles } = mesh.statistics;
      const done = missingPages === 0 && triangles > 0 && mesh.textures.missing === 0;
      this.element.classList.toggle("done", done);
      const part = Math.min(residentBytes / (wantedBytes || 1), 1);
      this.element.style.width = `${done ? 100 : 10 + 85 * part}%`;
      this.mark(counts, mesh);
    }
    clearTimeout(this.timer);
    const show = () => {
      this.lastCounters = performance.now();
      this.showCounts(counts, meshes);
    };
    if (performance.now() - this.lastCounters > COUNTER_INTERVAL) show();
    else this.timer = window.setTimeout(show, COUNTER_INTERVAL);
  }

  /** Marks when all visible materials have a texture of some size. */
  private mark({ triangles }: FrameCounts, { statistics, textures }: UmbelMesh): void {
    if (this.isMarked || triangles === 0 || !textures.isComplete) return;
    this.isMarked = true;
    performance.mark("umbel-first-textures", { detail: { ...statistics, textures } });
  }
}
