// The panel's counters: graphs of the last frames, and the strip of pages.

import type { FrameCounts, Meshes } from "../viewport/viewport";
import { bytes, count, h, short } from "./dom";
import { Graph, PageStrip } from "./graph";

export class Counters {
  readonly elements: readonly HTMLElement[];
  private readonly strip = new PageStrip();
  private readonly graphs = {
    triangles: new Graph("Triangles", "triangles", short),
    clusters: new Graph("Clusters", "clusters", count),
    draws: new Graph("Draw calls", "draws", count),
    memory: new Graph("Memory", "memory", bytes),
    textures: new Graph("Textures", "textures", bytes),
    fetched: new Graph("Fetched", "fetched", bytes),
    frame: new Graph("Frame", "frame", (ms) => `${ms.toFixed(1)} ms`),
  };

  constructor() {
    const graphs = Object.values(this.graphs).map(({ element }) => element);
    this.elements = [h("div", { className: "graphs" }, ...graphs), this.strip.element];
  }

  /** Numbers are of all meshes, the strip is of the first. */
  show(frame: FrameCounts, meshes: Meshes): void {
    const { graphs } = this;
    graphs.triangles.push(frame.triangles);
    graphs.clusters.push(frame.clusters);
    graphs.draws.push(frame.draws);
    graphs.frame.push(frame.interval || frame.work);
    const [mesh] = meshes;
    if (!mesh?.statistics) return;
    let [geometry, textures, fetched] = [0, 0, 0];
    for (const each of meshes) {
      if (!each?.statistics) continue;
      const { bytes, fetchedBytes } = each.textures;
      geometry += each.statistics.residentBytes;
      textures += bytes;
      fetched += each.statistics.fetchedBytes + fetchedBytes;
    }
    graphs.memory.push(geometry + textures);
    graphs.textures.push(textures);
    graphs.fetched.push(fetched);
    this.strip.draw(mesh.pages, mesh.info.pages);
  }
}
