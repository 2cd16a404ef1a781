// The panel's section for the allowed error and the memory.

import type { UmbelMesh } from "umbel/three";
import { BUDGETS, PIXELS, type State } from "../state";
import type { Meshes } from "../viewport/viewport";
import { LogSlider, section, Toggle } from "./controls";
import { bytes, h } from "./dom";

/** Factors below are too small to see. */
const LEAST_FACTOR = 1.01;

export class DetailSection {
  readonly element: HTMLElement;
  private readonly pixels: LogSlider;
  private readonly hold: Toggle;
  private readonly budget: LogSlider;
  private readonly limit = h("p", { className: "about", hidden: true });

  constructor(
    private readonly state: State,
    onChange: () => void,
    onBudget: (bytes: number) => void,
  ) {
    this.pixels = new LogSlider({
      name: "Error",
      label: "Allowed error in pixels",
      id: "pixels",
      range: PIXELS,
      format: (value) => `${value.toPrecision(2)} px`,
      onInput: (value) => {
        state.pixelError = value;
        onChange();
      },
    });
    const title = "Choose the error by the time a frame takes";
    this.hold = new Toggle("Hold 60 fps", title, "hold", (isOn) => {
      state.frameRate = isOn ? 60 : 0;
      onChange();
    });
    this.budget = new LogSlider({
      name: "Memory",
      label: "Memory for geometry and textures",
      id: "budget",
      range: BUDGETS,
      format: bytes,
      onInput: onBudget,
    });
    this.element = section(
      "Detail",
      this.pixels.element,
      this.hold.element,
      this.budget.element,
      this.limit,
    );
  }

  update(): void {
    const { pixelError, budget, frameRate } = this.state;
    this.pixels.set(pixelError);
    this.budget.set(budget);
    this.hold.set(frameRate > 0);
  }

  /** Says by which factor the budget raises the allowed error of each mesh. */
  showLimits([left, right]: Meshes): void {
    const texts: string[] = [];
    const factor = (mesh: UmbelMesh | undefined) => mesh?.statistics?.scale ?? 1;
    const times = (mesh: UmbelMesh | undefined) => `${factor(mesh).toPrecision(2)} times the error`;
    if (factor(left) > LEAST_FACTOR) texts.push(`The memory allows ${times(left)}.`);
    if (factor(right) > LEAST_FACTOR)
      texts.push(
        right?.pixelError === 0
          ? "The memory does not hold the full mesh: what is seen most is as fine as it allows."
          : `On the right the memory allows ${times(right)}.`,
      );
    this.limit.hidden = texts.length === 0;
    this.limit.textContent = texts.join(" ");
  }
}
