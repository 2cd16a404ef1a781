// What stands beside the picture: ways of looking, sliders, counters.

import type { UmbelMesh } from "umbel/three";
import { BUDGETS, type Layout, PIXELS, type State } from "../state";
import { LOOKS, type Look, legendOf, scaleGradient } from "../viewport/view_modes";
import type { FrameCounts } from "../viewport/viewport";
import { bytes, count, h, short } from "./dom";
import { Graph, PageStrip } from "./graph";

export interface Actions {
  change(): void;
  setBudget(bytes: number): void;
  setLayout(layout: Layout): void;
  chooseOther(): void;
  frameAll(): void;
  share(): void;
  screenshot(): void;
  record(): void;
  replay(): void;
  savePath(): void;
  help(): void;
  open(): void;
  theme(): void;
}

const LAYOUTS: Record<Layout, [string, string]> = {
  single: ["One", "One picture"],
  side: ["Side by side", "Beside the full mesh, or beside another asset"],
  wipe: ["Wipe", "A line to pull across, the full mesh or another asset behind it"],
};

function logSlider(
  low: number,
  high: number,
  label: string,
  id: string,
  onInput: (value: number) => void,
): { element: HTMLInputElement; set(value: number): void } {
  const element = h("input", {
    type: "range",
    min: "0",
    max: "1",
    step: "0.002",
    id,
    aria: { label },
    oninput: () => onInput(low * (high / low) ** Number(element.value)),
  });
  return {
    element,
    set: (value) => {
      element.value = String(Math.log(value / low) / Math.log(high / low));
    },
  };
}

function button(text: string, title: string, onclick: () => void, id?: string): HTMLButtonElement {
  return h("button", { type: "button", textContent: text, title, onclick, id });
}

export class Panel {
  readonly element: HTMLElement;
  private readonly looks = new Map<Look, HTMLButtonElement>();
  private readonly layouts = new Map<Layout, HTMLButtonElement>();
  private readonly about = h("p", { className: "about" });
  private readonly legend = h("div", { className: "legend" });
  private readonly pixels: { element: HTMLInputElement; set(value: number): void };
  private readonly pixelValue = h("output", { className: "value" });
  private readonly budget: { element: HTMLInputElement; set(value: number): void };
  private readonly budgetValue = h("output", { className: "value" });
  private readonly wireframe: HTMLInputElement;
  private readonly frozen: HTMLInputElement;
  private readonly hold: HTMLInputElement;
  private readonly limit = h("p", { className: "about", hidden: true });
  private readonly strip = new PageStrip();
  private readonly notes = h("ul", { className: "notes" });
  private readonly notesSection = this.section("Not shown", this.notes);
  private readonly recordButton: HTMLButtonElement;
  private readonly replayButton: HTMLButtonElement;
  private readonly saveButton: HTMLButtonElement;
  private readonly otherButton: HTMLButtonElement;
  private readonly graphs = {
    triangles: new Graph("Triangles", "triangles", short),
    clusters: new Graph("Clusters", "clusters", count),
    draws: new Graph("Draw calls", "draws", count),
    memory: new Graph("Memory", "memory", bytes),
    textures: new Graph("Textures", "textures", bytes),
    fetched: new Graph("Fetched", "fetched", bytes),
    frame: new Graph("Frame", "frame", (ms) => `${ms.toFixed(1)} ms`),
  };

  constructor(
    private readonly state: State,
    actions: Actions,
  ) {
    const toggle = (text: string, title: string, id: string, change: (on: boolean) => void) => {
      const input = h("input", {
        type: "checkbox",
        id,
        onchange: () => {
          change(input.checked);
          actions.change();
        },
      });
      return {
        input,
        label: h("label", { className: "toggle", title }, input, h("span", {}, text)),
      };
    };
    const wireframe = toggle("Wireframe", "Edges of triangles (W)", "wireframe", (on) => {
      state.wireframe = on;
    });
    const frozen = toggle("Freeze", "Keep what is drawn and fly around it (F)", "freeze", (on) => {
      state.frozen = on;
    });
    const hold = toggle(
      "Hold 60 fps",
      "Choose the pixels by the time a frame takes",
      "hold",
      (on) => {
        state.frameRate = on ? 60 : 0;
      },
    );
    this.wireframe = wireframe.input;
    this.frozen = frozen.input;
    this.hold = hold.input;
    this.pixels = logSlider(
      PIXELS.low,
      PIXELS.high,
      "Allowed error in pixels",
      "pixels",
      (value) => {
        state.pixelError = value;
        actions.change();
      },
    );
    this.budget = logSlider(
      BUDGETS.low,
      BUDGETS.high,
      "Memory for geometry and textures",
      "budget",
      (value) => {
        actions.setBudget(value);
      },
    );
    this.recordButton = button(
      "Record",
      "Record how the camera moves (R)",
      actions.record,
      "record",
    );
    this.replayButton = button("Replay", "Replay what was recorded (P)", actions.replay, "replay");
    this.saveButton = button(
      "Save path",
      "Save it as a file, to drop here later",
      actions.savePath,
    );
    this.otherButton = button("Other asset …", "Compare with another asset", actions.chooseOther);
    this.element = h(
      "aside",
      { className: "panel", id: "panel", aria: { label: "Settings" } },
      this.section(
        "Look",
        h("div", { className: "looks", role: "group" }, ...this.lookButtons(actions)),
        this.about,
        this.legend,
        h("div", { className: "row" }, wireframe.label, frozen.label),
      ),
      this.section(
        "Detail",
        this.slider("Error", this.pixelValue, this.pixels.element),
        hold.label,
        this.slider("Memory", this.budgetValue, this.budget.element),
        this.limit,
      ),
      this.section(
        "Now",
        h("div", { className: "graphs" }, ...Object.values(this.graphs).map((g) => g.element)),
        this.strip.element,
      ),
      this.notesSection,
      this.section(
        "Compare",
        h("div", { className: "layouts", role: "group" }, ...this.layoutButtons(actions)),
        this.otherButton,
      ),
      this.section(
        "Camera",
        h(
          "div",
          { className: "buttons" },
          button("Whole asset", "Show all of it (Home)", actions.frameAll),
          this.recordButton,
          this.replayButton,
          this.saveButton,
        ),
      ),
      h(
        "footer",
        { className: "buttons" },
        button("Open …", "Open a file from this device (O)", actions.open),
        button("Link", "Copy a link to what is seen (L)", actions.share, "share"),
        button("Picture", "Save the picture as PNG (S)", actions.screenshot, "picture"),
        button("Theme", "Dark or light (T)", actions.theme, "theme"),
        button("Keys", "What the keys do (?)", actions.help, "help"),
      ),
    );
    this.setPath(false, false);
    this.setNotes([]);
    this.update();
  }

  /** What of the asset cannot be shown. */
  setNotes(notes: readonly string[]): void {
    this.notesSection.hidden = notes.length === 0;
    this.notes.replaceChildren(...notes.map((text) => h("li", { textContent: text })));
  }

  private section(title: string, ...children: Node[]): HTMLElement {
    return h("section", {}, h("h2", { textContent: title }), ...children);
  }

  private slider(name: string, value: HTMLElement, input: HTMLInputElement): HTMLElement {
    return h(
      "label",
      { className: "slider" },
      h("span", { className: "name", textContent: name }),
      value,
      input,
    );
  }

  private lookButtons(actions: Actions): HTMLButtonElement[] {
    return (Object.keys(LOOKS) as Look[]).map((look) => {
      const { name, about, key } = LOOKS[look];
      const element = button(name, `${about} (${key})`, () => {
        this.state.look = look;
        actions.change();
      });
      element.dataset.look = look;
      this.looks.set(look, element);
      return element;
    });
  }

  private layoutButtons(actions: Actions): HTMLButtonElement[] {
    return (Object.keys(LAYOUTS) as Layout[]).map((layout) => {
      const [name, title] = LAYOUTS[layout];
      const element = button(name, title, () => actions.setLayout(layout));
      element.dataset.layout = layout;
      this.layouts.set(layout, element);
      return element;
    });
  }

  /** Shows what is set. */
  update(): void {
    const { state } = this;
    for (const [look, element] of this.looks)
      element.setAttribute("aria-pressed", String(look === state.look));
    for (const [layout, element] of this.layouts)
      element.setAttribute("aria-pressed", String(layout === state.layout));
    this.otherButton.hidden = state.layout === "single";
    this.about.textContent = LOOKS[state.look].about;
    const legend = legendOf(state.look);
    this.legend.hidden = !legend;
    if (legend)
      this.legend.replaceChildren(
        h("span", {}, legend.low),
        h("i", { style: undefined, className: "scale" }),
        h("span", {}, legend.high),
      );
    this.legend.style.setProperty("--scale", scaleGradient());
    this.pixels.set(state.pixelError);
    this.pixelValue.textContent = `${state.pixelError.toPrecision(2)} px`;
    this.budget.set(state.budget);
    this.budgetValue.textContent = bytes(state.budget);
    this.wireframe.checked = state.wireframe;
    this.frozen.checked = state.frozen;
    this.hold.checked = state.frameRate > 0;
  }

  setPath(isRecording: boolean, hasPath: boolean): void {
    this.recordButton.textContent = isRecording ? "Stop" : "Record";
    this.recordButton.setAttribute("aria-pressed", String(isRecording));
    this.replayButton.disabled = !hasPath || isRecording;
    this.saveButton.disabled = !hasPath || isRecording;
  }

  showCounts(frame: FrameCounts, mesh: UmbelMesh | undefined): void {
    this.graphs.triangles.push(frame.triangles);
    this.graphs.clusters.push(frame.clusters);
    this.graphs.draws.push(frame.draws);
    this.graphs.frame.push(frame.interval || frame.work);
    const stream = mesh?.statistics;
    if (!mesh || !stream) return;
    const { textures } = mesh;
    this.graphs.memory.push(stream.residentBytes + textures.bytes);
    this.graphs.textures.push(textures.bytes);
    this.graphs.fetched.push(stream.fetchedBytes + textures.fetchedBytes);
    this.strip.draw(mesh.pages);
    this.limit.hidden = stream.scale <= 1.01;
    this.limit.textContent = `The memory allows ${stream.scale.toPrecision(2)} times the error.`;
  }
}
