// The viewer: opens assets, and joins the stage with what stands around it.

import { AssetStream, UmbelError } from "umbel";
import { UmbelMesh } from "umbel/three";
import { CameraPath } from "./camera_path";
import { paintBackground, readJson, save } from "./files";
import type { Sketch } from "./preview/preview_renderer";
import {
  type CameraPose,
  type Layout,
  nameOf,
  PIXELS,
  type Source,
  type State,
  writeLink,
} from "./state";
import { pickedCard } from "./ui/cluster_card";
import { Split } from "./ui/divider";
import { h } from "./ui/dom";
import { listenToDrops, listenToKeys, listenToPointer } from "./ui/input";
import { helpDialog, Notice, Problem, titleOf } from "./ui/messages";
import { Panel } from "./ui/panel";
import { Progress } from "./ui/progress";
import { toggleTheme } from "./ui/theme";
import { showTitle } from "./ui/title";
import { LOOKS, type Look } from "./viewport/view_modes";
import { type FrameCounts, Stage } from "./viewport/viewport";

interface Opening {
  pose?: CameraPose | undefined;
  early?: Promise<AssetStream> | undefined;
  /** What is seen until this draws. */
  sketch?: Sketch | undefined;
}

export class Viewer {
  readonly stage: Stage;
  private readonly panel: Panel;
  private readonly path = new CameraPath();
  private readonly notes = new Set<string>();
  private readonly problem = new Problem();
  private readonly notice = new Notice();
  private readonly help = helpDialog();
  private readonly title = h("div", { className: "title" });
  private readonly progress = new Progress((counts, mesh) => this.panel.showCounts(counts, mesh));
  private readonly split: Split;
  private readonly dropHint = h(
    "div",
    { className: "drop", hidden: true },
    "Drop an .umbel file here",
  );
  private readonly chooser = h("input", { type: "file", accept: ".umbel,.json", hidden: true });
  private readonly sheetButton: HTMLButtonElement;
  private card: HTMLElement | undefined;
  private sketch: Sketch | undefined;
  private source: Source | undefined;
  private other: Source | undefined;
  private choosesOther = false;
  private opened = 0;
  private damagedShown = 0;

  constructor(
    private readonly root: HTMLElement,
    readonly state: State,
  ) {
    const host = h("div", { className: "stage" });
    this.panel = new Panel(this.state, {
      change: () => this.apply(),
      setBudget: (bytes) => this.setBudget(bytes),
      setLayout: (layout) => void this.setLayout(layout),
      chooseOther: () => this.choose(true),
      frameAll: () => this.stage.frameAll(),
      share: () => void this.share(),
      screenshot: () => void this.screenshot(),
      record: () => this.toggleRecording(),
      replay: () => this.replay(),
      savePath: () => this.savePath(),
      help: () => this.help.showModal(),
      open: () => this.choose(false),
      theme: () => this.toggleTheme(),
    });
    this.sheetButton = h("button", {
      className: "sheet",
      type: "button",
      textContent: "Settings",
      onclick: () => this.togglePanel(),
      aria: { controls: "panel" },
    });
    root.append(
      host,
      this.progress.element,
      this.title,
      this.panel.element,
      this.sheetButton,
      this.notice.element,
      this.problem.element,
      this.dropHint,
      this.chooser,
      this.help,
    );
    this.sheetButton.setAttribute("aria-expanded", String(!root.classList.contains("plain")));
    this.stage = new Stage(host, this.state);
    this.split = new Split(host, (at) => {
      this.state.wipe = at;
      this.placeDivider();
    });
    this.stage.onFrame = (counts) => this.onFrame(counts);
    this.stage.beforeFrame = (time) => this.moveCamera(time);
    this.listen(host);
  }

  /** Shows the asset that the page's address names, which may be on its way already. */
  start(asset: string | undefined, opening: Opening): void {
    const search = new URLSearchParams(location.search);
    this.other = search.get("compare") ?? undefined;
    if (this.other && this.state.layout === "single") this.state.layout = "wipe";
    this.panel.update();
    if (!asset) {
      this.problem.show(
        "Nothing to show yet",
        "Drop an .umbel file here, choose one, or add ?asset=ADDRESS to this page’s address.",
        [{ text: "Choose a file", action: () => this.choose(false) }],
      );
      return;
    }
    void this.open(asset, opening);
  }

  async open(source: Source, { pose, early, sketch }: Opening = {}): Promise<void> {
    const turn = ++this.opened;
    this.sketch = sketch;
    this.problem.hide();
    this.letGo();
    this.title.replaceChildren(h("h1", { textContent: nameOf(source) }), h("p", {}, "Opening …"));
    this.progress.begin();
    this.notes.clear();
    this.panel.setNotes([]);
    try {
      const mesh = await this.load(source, this.state.pixelError, early);
      if (turn !== this.opened) return mesh.dispose();
      this.source = source;
      this.stage.setMesh(0, mesh);
      if (pose) this.stage.setPose(pose);
      else this.stage.frameAll();
      showTitle(this.title, mesh, source);
      await this.setLayout(this.state.layout);
    } catch (error) {
      if (turn === this.opened) this.fail(error, source);
    }
  }

  private async load(
    source: Source,
    pixelError: number,
    early?: Promise<AssetStream>,
  ): Promise<UmbelMesh> {
    const stream = early ?? AssetStream.open(source, { budget: this.state.budget });
    const mesh = new UmbelMesh(await stream, { pixelError });
    mesh.materials.onNote = (text) => this.showNote(text);
    for (const text of mesh.materials.notes) this.showNote(text);
    mesh.onConnection = (isLost) => {
      if (isLost) this.notice.show("The connection is lost. Trying again …", true);
      else this.notice.show("The connection is back.");
    };
    return mesh;
  }

  private fail(error: unknown, source: Source): void {
    this.dropSketch();
    this.title.replaceChildren();
    this.progress.end();
    this.problem.show(
      titleOf(error instanceof UmbelError ? error.kind : "unsupported"),
      error instanceof Error ? error.message : String(error),
      [
        { text: "Try again", action: () => void this.open(source) },
        { text: "Open another file", action: () => this.choose(false) },
      ],
    );
  }

  /** Says what cannot be shown: once in passing, and in the panel. */
  private showNote(text: string): void {
    if (this.notes.has(text)) return;
    this.notes.add(text);
    this.panel.setNotes([...this.notes]);
    this.notice.show(text);
  }

  private apply(): void {
    this.panel.update();
    this.stage.apply();
  }

  private setBudget(bytes: number): void {
    this.state.budget = bytes;
    for (const mesh of this.stage.meshes) mesh?.setBudget(bytes);
    this.panel.update();
    this.stage.ask();
  }

  private async setLayout(layout: Layout): Promise<void> {
    const { stage } = this;
    const wasHome = stage.isHome;
    this.state.layout = layout;
    if (wasHome) stage.frameAll();
    if (layout === "single") stage.setMesh(1, undefined);
    else if (!stage.meshes[1] && this.source) {
      try {
        // Beside the full mesh nothing is left out; another asset is seen as this one is.
        const pixelError = this.other ? this.state.pixelError : 0;
        stage.setMesh(1, await this.load(this.other ?? this.source, pixelError));
        stage.rightFollows = this.other !== undefined;
      } catch (error) {
        this.state.layout = "single";
        this.notice.show(error instanceof Error ? error.message : String(error));
      }
    }
    this.placeDivider();
    this.apply();
  }

  private placeDivider(): void {
    const right = this.other ? nameOf(this.other) : "Full mesh";
    const left = this.source ? nameOf(this.source) : "";
    this.split.place(this.state.layout, this.state.wipe, [left, right]);
    this.stage.ask();
  }

  private choose(other: boolean): void {
    this.choosesOther = other;
    this.chooser.value = "";
    this.chooser.click();
  }

  private async take(file: File, other: boolean): Promise<void> {
    if (file.name.endsWith(".json")) {
      const isPath = this.path.fromFile(await readJson(file));
      this.notice.show(isPath ? "Camera path read: press P." : "This is not a camera path.");
      this.panel.setPath(false, !this.path.isEmpty);
    } else if (other) {
      this.other = file;
      this.stage.setMesh(1, undefined);
      await this.setLayout(this.state.layout === "single" ? "wipe" : this.state.layout);
    } else await this.open(file);
  }

  private async share(): Promise<void> {
    const address = new URL(location.href);
    address.hash = writeLink(this.state, this.stage.pose);
    history.replaceState(null, "", address);
    const copied = await navigator.clipboard?.writeText(address.href).then(
      () => true,
      () => false,
    );
    const isLocal = typeof this.source !== "string";
    this.notice.show(
      isLocal
        ? "The link has the view, but a file of this device cannot be in it."
        : copied
          ? "Link copied."
          : "The link is in the address bar.",
    );
  }

  private async screenshot(): Promise<void> {
    const blob = await this.stage.picture((context) => paintBackground(context));
    save(blob, `${document.title.split(" – ")[0]}.png`);
  }

  private toggleRecording(): void {
    if (this.path.isRecording) {
      this.path.stop();
      this.notice.show(this.path.isEmpty ? "Nothing moved." : "Recorded. P replays it.");
    } else {
      this.path.startRecording();
      this.notice.show("Recording: move the camera. R ends it.", true);
    }
    this.panel.setPath(this.path.isRecording, !this.path.isEmpty);
    this.stage.ask();
  }

  private replay(): void {
    if (this.path.isReplaying) this.path.stop();
    else this.path.startReplay();
    this.stage.ask();
  }

  private savePath(): void {
    const text = JSON.stringify(this.path.toFile());
    save(new Blob([text], { type: "application/json" }), "camera-path.json");
  }

  private moveCamera(time: number): boolean {
    if (this.path.isRecording) {
      this.path.record(time, this.stage.pose);
      return true;
    }
    if (!this.path.isReplaying) return false;
    const pose = this.path.poseAt(time);
    if (pose) this.stage.setPose(pose);
    return this.path.isReplaying;
  }

  private dropSketch(): void {
    this.sketch?.dispose();
    this.sketch = undefined;
  }

  private onFrame(counts: FrameCounts): void {
    if (counts.triangles > 0) this.dropSketch();
    if (this.state.frameRate > 0) this.holdFrameRate(counts.interval);
    const [mesh] = this.stage.meshes;
    this.progress.update(counts, mesh);
    const damaged = mesh?.statistics?.damagedPages ?? 0;
    if (damaged > this.damagedShown) {
      this.damagedShown = damaged;
      const pages = damaged === 1 ? "A page" : `${damaged} pages`;
      this.notice.show(`${pages} of the file did not arrive whole: it stays coarse there.`, true);
    }
  }

  /** Allows more error while frames take too long, and less again when there is time. */
  private holdFrameRate(interval: number): void {
    if (interval <= 0 || interval > 1000) return;
    const wanted = 1000 / this.state.frameRate;
    const factor = interval > 1.25 * wanted ? 1.04 : interval < 1.05 * wanted ? 0.99 : 1;
    const pixels = Math.min(Math.max(this.state.pixelError * factor, 1), PIXELS.high);
    if (pixels === this.state.pixelError) return;
    this.state.pixelError = pixels;
    this.panel.update();
  }

  private pick(x: number, y: number): void {
    const found = this.stage.pick(x, y);
    this.letGo();
    if (!found) return;
    const tangent = Math.tan((this.stage.camera.fov * Math.PI) / 360);
    const pixelsPerUnit = this.stage.height / (2 * tangent * found.distance);
    this.card = pickedCard(found, pixelsPerUnit, () => this.letGo());
    this.root.append(this.card);
    this.stage.picked = found.cluster.cluster;
    this.stage.apply();
  }

  private letGo(): void {
    this.card?.remove();
    this.card = undefined;
    if (this.stage?.picked === undefined) return;
    this.stage.picked = undefined;
    this.stage.apply();
  }

  private togglePanel(): void {
    const isClosed = this.root.classList.toggle("plain");
    this.sheetButton.setAttribute("aria-expanded", String(!isClosed));
  }

  private toggleTheme(): void {
    toggleTheme();
    this.stage.apply();
  }

  private listen(host: HTMLElement): void {
    this.chooser.onchange = () => {
      const file = this.chooser.files?.[0];
      if (file) void this.take(file, this.choosesOther);
    };
    listenToPointer(host, {
      down: () => {
        if (this.path.isReplaying) this.path.stop();
      },
      click: (x, y) => this.pick(x, y),
    });
    listenToDrops(this.dropHint, (file, x) => {
      void this.take(file, this.state.layout !== "single" && x > innerWidth / 2);
    });
    listenToKeys((key) => this.press(key));
  }

  private press(key: string): boolean {
    if (this.help.open) return false;
    const action = this.keys[key];
    const look = (Object.keys(LOOKS) as Look[]).find((each) => LOOKS[each].key === key);
    if (look) {
      this.state.look = look;
      this.apply();
    } else if (action) action();
    else return false;
    return true;
  }

  private scaleError(factor: number): void {
    const pixels = this.state.pixelError * factor;
    this.state.pixelError = Math.min(Math.max(pixels, PIXELS.low), PIXELS.high);
    this.apply();
  }

  private readonly keys: Record<string, () => void> = {
    w: () => {
      this.state.wireframe = !this.state.wireframe;
      this.apply();
    },
    f: () => {
      this.state.frozen = !this.state.frozen;
      this.apply();
    },
    c: () => {
      const layouts: Layout[] = ["single", "side", "wipe"];
      void this.setLayout(layouts[(layouts.indexOf(this.state.layout) + 1) % 3] as Layout);
    },
    "+": () => this.scaleError(2 ** -0.5),
    "=": () => this.scaleError(2 ** -0.5),
    "-": () => this.scaleError(2 ** 0.5),
    r: () => this.toggleRecording(),
    p: () => this.replay(),
    Home: () => this.stage.frameAll(),
    l: () => void this.share(),
    s: () => void this.screenshot(),
    o: () => this.choose(false),
    t: () => this.toggleTheme(),
    h: () => this.togglePanel(),
    "?": () => this.help.showModal(),
    Escape: () => this.letGo(),
    ArrowLeft: () => this.stage.fly(-0.06, 0, 0),
    ArrowRight: () => this.stage.fly(0.06, 0, 0),
    ArrowUp: () => this.stage.fly(0, 0.06, 0),
    ArrowDown: () => this.stage.fly(0, -0.06, 0),
    a: () => this.stage.fly(-0.06, 0, 0),
    d: () => this.stage.fly(0.06, 0, 0),
    q: () => this.stage.fly(0, -0.06, 0),
    e: () => this.stage.fly(0, 0.06, 0),
    PageUp: () => this.stage.fly(0, 0, 0.08),
    PageDown: () => this.stage.fly(0, 0, -0.08),
  };
}
