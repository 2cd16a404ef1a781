// The line between two compared assets, and the name on each side.

import type { Layout } from "../state";
import { h } from "./dom";

export class Divider {
  readonly divider = h("div", { className: "divider", hidden: true });
  readonly names = h("div", { className: "names", hidden: true });

  /** @param onMove is called with the position of a dragged line, from 0 (left) to 1 */
  constructor(host: HTMLElement, onMove: (at: number) => void) {
    const { divider } = this;
    divider.addEventListener("pointerdown", (event) => divider.setPointerCapture(event.pointerId));
    divider.addEventListener("pointermove", (event) => {
      if (!divider.hasPointerCapture(event.pointerId)) return;
      const { left, width } = host.getBoundingClientRect();
      onMove(Math.min(Math.max((event.clientX - left) / width, 0.02), 0.98));
    });
    host.append(this.names, divider);
  }

  update(layout: Layout, wipe: number, names: readonly [string, string]): void {
    const isSplit = layout !== "single";
    this.divider.hidden = !isSplit;
    this.names.hidden = !isSplit;
    this.divider.classList.toggle("fixed", layout === "side");
    const at = layout === "side" ? 0.5 : wipe;
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
