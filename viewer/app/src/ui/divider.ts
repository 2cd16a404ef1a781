// The line between two compared assets, and the name on each side.

import type { Layout } from "../state";
import { h } from "./dom";

/** The range of the line. */
const RANGE = { low: 0.02, high: 0.98 };
/** Moves of the line by keys. */
const STEPS: Record<string, number> = {
  ArrowLeft: -0.02,
  ArrowDown: -0.02,
  ArrowRight: 0.02,
  ArrowUp: 0.02,
  PageDown: -0.1,
  PageUp: 0.1,
  Home: -1,
  End: 1,
};

export class Divider {
  readonly divider = h("div", {
    className: "divider",
    hidden: true,
    aria: {
      label: "Line between the pictures",
      valuemin: String(100 * RANGE.low),
      valuemax: String(100 * RANGE.high),
    },
  });
  private at = 0.5;
  readonly names = h("div", { className: "names", hidden: true });

  /** @param onMove is called with the position of a moved line, from 0 (left) to 1 */
  constructor(host: HTMLElement, onMove: (at: number) => void) {
    const { divider } = this;
    const move = (at: number) => onMove(Math.min(Math.max(at, RANGE.low), RANGE.high));
    divider.addEventListener("pointerdown", (event) => divider.setPointerCapture(event.pointerId));
    divider.addEventListener("pointermove", (event) => {
      if (!divider.hasPointerCapture(event.pointerId)) return;
      const { left, width } = host.getBoundingClientRect();
      move((event.clientX - left) / width);
    });
    divider.addEventListener("keydown", (event) => {
      const step = STEPS[event.key];
      if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      move(this.at + step);
    });
    host.append(this.names, divider);
  }

  update(layout: Layout, wipe: number, names: readonly [string, string]): void {
    const isSplit = layout !== "single";
    this.divider.hidden = !isSplit;
    this.names.hidden = !isSplit;
    this.divider.classList.toggle("fixed", layout === "side");
    const at = layout === "side" ? 0.5 : wipe;
    this.at = at;
    // Side by side the line cannot be moved.
    this.divider.tabIndex = layout === "wipe" ? 0 : -1;
    this.divider.setAttribute("role", layout === "wipe" ? "slider" : "presentation");
    this.divider.setAttribute("aria-valuenow", String(Math.round(100 * at)));
    this.divider.style.left = `${100 * at}%`;
    this.names.replaceChildren(
      ...names.map((text, i) => {
        const span = h("span", { textContent: text });
        span.style.width = `${100 * (i ? 1 - at : at)}%`;
        return span;
      }),
    );
  }
}
