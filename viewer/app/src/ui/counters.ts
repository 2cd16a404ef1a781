// The panel's counters: graphs of the last frames, and the strip of pages.

import type { UmbelMesh } from "umbel/three";
import type { FrameCounts } from "../viewport/viewport";
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

  show(frame: FrameCounts, mesh: UmbelMesh | undefined): void {
    const { graphs } = this;
    graphs.triangles.push(frame.triangles);
    graphs.clusters.push(frame.clusters);
    graphs.draws.push(frame.draws);
    graphs.frame.push(frame.interval || frame.work);
    const stream = mesh?.statistics;
    if (!mesh || !stream) return;
    const { textures } = mesh;
    graphs.memory.push(stream.residentBytes + textures.bytes);
    graphs.textures.push(textures.bytes);
    graphs.fetched.push(stream.fetchedBytes + textures.fetchedBytes);
    this.strip.draw(mesh.pages, mesh.info.pages);
  }
}
