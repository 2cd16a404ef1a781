// The counters' graphs, and the strip of pages.

import { h } from "./dom";

const POINTS = 60;
const WIDTH = 64;
const HEIGHT = 18;

/** A number with its recent values as a line. */
export class Graph {
  readonly element: HTMLElement;
  private readonly value = h("span", { className: "value" });
  private readonly canvas = h("canvas", { width: 2 * WIDTH, height: 2 * HEIGHT });
  private readonly points: number[] = [];

  constructor(
    name: string,
    id: string,
    private readonly format: (value: number) => string,
  ) {
    this.element = h(
      "div",
      { className: "graph", data: { counter: id } },
      h("span", { className: "name", textContent: name }),
      this.canvas,
      this.value,
    );
    this.canvas.setAttribute("aria-hidden", "true");
  }

  push(value: number): void {
    this.points.push(value);
    if (this.points.length > POINTS) this.points.shift();
    this.value.textContent = this.format(value);
    this.value.dataset.value = String(value);
    this.draw();
  }

  private draw(): void {
    const context = this.canvas.getContext("2d") as CanvasRenderingContext2D;
    const max = Math.max(...this.points, 1e-9) * 1.1;
    const { width, height } = this.canvas;
    context.clearRect(0, 0, width, height);
    context.beginPath();
    this.points.forEach((point, i) => {
      const x = width - ((this.points.length - 1 - i) * width) / (POINTS - 1);
      context.lineTo(x, height - 2 - (point / max) * (height - 4));
    });
    context.strokeStyle = getComputedStyle(this.canvas).color;
    context.lineWidth = 2;
    context.lineJoin = "round";
    context.stroke();
  }
}

const STATES = ["--page-absent", "--page-loading", "--page-resident", "--page-damaged"];

/** The states of all pages, in the order of the file. */
export class PageStrip {
  readonly element = h("canvas", { className: "strip", width: 520, height: 44 });

  constructor() {
    this.element.setAttribute("role", "img");
    this.element.setAttribute("aria-label", "No pages yet.");
  }

  /** @param pages the states of pages that are not absent, of `count` pages */
  draw(pages: ReadonlyMap<number, number>, count: number): void {
    const context = this.element.getContext("2d") as CanvasRenderingContext2D;
    const style = getComputedStyle(this.element);
    const colors = STATES.map((name) => style.getPropertyValue(name));
    const { width, height } = this.element;
    context.clearRect(0, 0, width, height);
    const rows = count > 520 ? 4 : 2;
    const columns = Math.max(Math.ceil(count / rows), 1);
    const [w, hgt] = [width / columns, height / rows];
    const fill = (page: number, state: number) => {
      context.fillStyle = colors[state] as string;
      const [x, y] = [(page % columns) * w, Math.floor(page / columns) * hgt];
      context.fillRect(x, y, Math.max(w - (w > 3 ? 1 : 0), 0.5), hgt - 2);
    };
    // Narrow cells touch each other: those of absent pages are one bar a row.
    if (w > 3) for (let page = 0; page < count; ++page) fill(page, pages.get(page) ?? 0);
    else {
      context.fillStyle = colors[0] as string;
      for (let row = 0; row < rows; ++row) {
        const cells = Math.min(columns, count - row * columns);
        context.fillRect(0, row * hgt, cells * w, hgt - 2);
      }
      for (const [page, state] of pages) fill(page, state);
    }
    const resident = [...pages.values()].filter((state) => state === 2).length;
    this.element.setAttribute("aria-label", `${resident} of ${count} pages are in memory.`);
  }
}
