// The panel's section for the view mode, wireframe and freezing.

import type { State } from "../state";
import { legendOf, scaleGradient, VIEW_MODES, type ViewMode } from "../viewport/view_modes";
import { Choice, section, Toggle } from "./controls";
import { h } from "./dom";

export class ViewSection {
  readonly element: HTMLElement;
  private readonly modes: Choice<ViewMode>;
  private readonly about = h("p", { className: "about" });
  private readonly legend = h("div", { className: "legend" });
  private readonly wireframe: Toggle;
  private readonly frozen: Toggle;

  constructor(
    private readonly state: State,
    onChange: () => void,
  ) {
    this.modes = new Choice("View mode", "view-modes", "mode", modeChoices(), (mode) => {
      state.viewMode = mode;
      onChange();
    });
    this.wireframe = new Toggle("Wireframe", "Edges of triangles (W)", "wireframe", (isOn) => {
      state.wireframe = isOn;
      onChange();
    });
    const title = "Keep what is drawn and fly around it (F)";
    this.frozen = new Toggle("Freeze", title, "freeze", (isOn) => {
      state.frozen = isOn;
      onChange();
    });
    this.element = section(
      "View",
      this.modes.element,
      this.about,
      this.legend,
      h("div", { className: "row" }, this.wireframe.element, this.frozen.element),
    );
  }

  update(): void {
    const { viewMode, wireframe, frozen } = this.state;
    this.modes.set(viewMode);
    this.about.textContent = VIEW_MODES[viewMode].about;
    this.wireframe.set(wireframe);
    this.frozen.set(frozen);
    const legend = legendOf(viewMode);
    this.legend.hidden = !legend;
    if (legend)
      this.legend.replaceChildren(
        h("span", {}, legend.low),
        h("i", { className: "scale" }),
        h("span", {}, legend.high),
      );
    this.legend.style.setProperty("--scale", scaleGradient());
  }
}

/** Text and title of each view mode's button. */
function modeChoices(): Record<ViewMode, readonly [string, string]> {
  const entries = Object.entries(VIEW_MODES).map(([mode, { name, about, key }]) => [
    mode,
    [name, `${about} (${key})`],
  ]);
  return Object.fromEntries(entries);
}
