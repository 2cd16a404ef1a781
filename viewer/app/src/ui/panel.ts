// The panel: view, detail, counters, comparison, camera, and actions.

import type { Layout, State } from "../state";
import type { FrameCounts, Meshes } from "../viewport/viewport";
import { button, Choice, section } from "./controls";
import { Counters } from "./counters";
import { DetailSection } from "./detail_section";
import { h } from "./dom";
import { ViewSection } from "./view_section";

/** What the panel's controls do. */
export interface Actions {
  /** A setting has changed. */
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
  wipe: ["Wipe", "A line to drag across, with the full mesh or another asset behind it"],
};

export class Panel {
  readonly element: HTMLElement;
  private readonly view: ViewSection;
  private readonly detail: DetailSection;
  private readonly counters = new Counters();
  private readonly notes = h("ul", { className: "notes" });
  private readonly notesSection = section("Not shown", this.notes);
  private readonly layouts: Choice<Layout>;
  private readonly otherButton: HTMLButtonElement;
  private readonly recordButton: HTMLButtonElement;
  private readonly replayButton: HTMLButtonElement;
  private readonly saveButton: HTMLButtonElement;

  constructor(
    private readonly state: State,
    actions: Actions,
  ) {
    this.view = new ViewSection(state, actions.change);
    this.detail = new DetailSection(state, actions.change, actions.setBudget);
    this.layouts = new Choice("Comparison", "layouts", "layout", LAYOUTS, actions.setLayout);
    this.otherButton = button("Other asset …", "Compare with another asset", actions.chooseOther);
    this.recordButton = button("Record", "Record the camera (R)", actions.record, "record");
    this.replayButton = button("Replay", "Replay the recording (P)", actions.replay, "replay");
    const title = "Save the recording as a file, to drop here later";
    this.saveButton = button("Save path", title, actions.savePath);
    this.element = h(
      "aside",
      { className: "panel", id: "panel", aria: { label: "Settings" } },
      this.view.element,
      this.detail.element,
      section("Now", ...this.counters.elements),
      this.notesSection,
      section("Compare", this.layouts.element, this.otherButton),
      this.cameraSection(actions),
      footer(actions),
    );
    this.setPath(false, false);
    this.setNotes([]);
    this.update();
  }

  private cameraSection(actions: Actions): HTMLElement {
    const buttons = [
      button("Whole asset", "Show the whole asset (Home)", actions.frameAll),
      this.recordButton,
      this.replayButton,
      this.saveButton,
    ];
    return section("Camera", h("div", { className: "buttons" }, ...buttons));
  }

  /** Lists what of the asset is not shown. */
  setNotes(notes: readonly string[]): void {
    this.notesSection.hidden = notes.length === 0;
    this.notes.replaceChildren(...notes.map((text) => h("li", { textContent: text })));
  }

  /** Shows the settings. */
  update(): void {
    this.view.update();
    this.detail.update();
    this.layouts.set(this.state.layout);
    this.otherButton.hidden = this.state.layout === "single";
  }

  /** Shows what can be done with the camera path. */
  setPath(isRecording: boolean, hasPath: boolean): void {
    this.recordButton.textContent = isRecording ? "Stop" : "Record";
    this.recordButton.setAttribute("aria-pressed", String(isRecording));
    this.replayButton.disabled = !hasPath || isRecording;
    this.saveButton.disabled = !hasPath || isRecording;
  }

  showCounts(frame: FrameCounts, meshes: Meshes): void {
    this.counters.show(frame, meshes);
    this.detail.showLimits(meshes);
  }
}

function footer(actions: Actions): HTMLElement {
  return h(
    "footer",
    { className: "buttons" },
    button("Open …", "Open a file from this device (O)", actions.open),
    button("Link", "Copy a link to this view (L)", actions.share, "share"),
    button("Picture", "Save the picture as PNG (S)", actions.screenshot, "picture"),
    button("Theme", "Dark or light (T)", actions.theme, "theme"),
    button("Keys", "List the keys (?)", actions.help, "help"),
  );
}
