// The viewer: opens assets, and joins the stage with what stands around it.

import { AssetStream, UmbelError } from "umbel";
import { UmbelMesh } from "umbel/three";
import { count, h } from "./dom";
import { LOOKS, type Look } from "./looks";
import { helpDialog, Notice, Problem } from "./notes";
import { Panel } from "./panel";
import { CameraPath } from "./path";
import { pickedCard } from "./picked";
import type { Sketch } from "./sketch";
import { type FrameCounts, Stage } from "./stage";
import {
  type CameraPose,
  type Layout,
  nameOf,
  PIXELS,
  type Source,
  type State,
  writeLink,
} from "./state";
import { toggleTheme } from "./theme";

interface Opening {
  pose?: CameraPose | undefined;
  early?: Promise<AssetStream> | undefined;
  /** What is seen until this draws. */
  sketch?: Sketch | undefined;
}

const COUNTER_INTERVAL = 200;
/** A click that moves farther than this, in pixels, is a drag. */
const CLICK = 5;

export class Viewer {
  readonly stage: Stage;
  private readonly panel: Panel;
  private readonly path = new CameraPath();
  private readonly problem = new Problem();
  private readonly notice = new Notice();
  private readonly help = helpDialog();
  private readonly title = h("div", { className: "title" });
  private readonly progress = h("div", { className: "progress" });
  private readonly divider = h("div", { className: "divider", hidden: true });
  private readonly names = h("div", { className: "names", hidden: true });
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
  private lastCounters = 0;
  private counterTimer = 0;
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
      this.progress,
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
    host.append(this.names, this.divider);
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
    this.progress.classList.remove("done");
    this.progress.style.width = "6%";
    try {
      const mesh = await this.load(source, this.state.pixelError, early);
      if (turn !== this.opened) return mesh.dispose();
      this.source = source;
      this.stage.setMesh(0, mesh);
      if (pose) this.stage.setPose(pose);
      else this.stage.frameAll();
      this.showTitle(mesh, source);
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
    mesh.onConnection = (isLost) => {
      if (isLost) this.notice.show("The connection is lost. Trying again …", true);
      else this.notice.show("The connection is back.");
    };
    return mesh;
  }

  private fail(error: unknown, source: Source): void {
    this.dropSketch();
    const kind = error instanceof UmbelError ? error.kind : "unsupported";
    const titles: Record<string, string> = {
      network: "No connection",
      missing: "Not found",
      "not-umbel": "Not an .umbel file",
      version: "Another version",
      corrupt: "Damaged file",
      unsupported: "This did not work",
    };
    this.title.replaceChildren();
    this.progress.classList.add("done");
    this.problem.show(
      titles[kind] ?? "This did not work",
      error instanceof Error ? error.message : String(error),
      [
        { text: "Try again", action: () => void this.open(source) },
        { text: "Open another file", action: () => this.choose(false) },
      ],
    );
  }

  private showTitle(mesh: UmbelMesh, source: Source): void {
    const { instancedTriangles, levels, metadata } = mesh.info;
    const name =
      typeof metadata.name === "string" && metadata.name ? metadata.name : nameOf(source);
    document.title = `${name} – Umbel`;
    this.title.replaceChildren(
      h("h1", { textContent: name }),
      h("p", { textContent: `${count(instancedTriangles)} triangles, ${levels} levels` }),
    );
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
    const { layout, wipe } = this.state;
    const isSplit = layout !== "single";
    this.divider.hidden = !isSplit;
    this.names.hidden = !isSplit;
    this.divider.classList.toggle("fixed", layout === "side");
    const at = layout === "side" ? 0.5 : wipe;
    this.divider.style.left = `${100 * at}%`;
    const right = this.other ? nameOf(this.other) : "Full mesh";
    this.names.replaceChildren(
      ...[this.source ? nameOf(this.source) : "", right].map((text, i) => {
        const span = h("span", { textContent: text });
        span.style.width = `${100 * (i ? 1 - at : at)}%`;
        return span;
      }),
    );
    this.stage.ask();
  }

  private choose(other: boolean): void {
    this.choosesOther = other;
    this.chooser.value = "";
    this.chooser.click();
  }

  private async take(file: File, other: boolean): Promise<void> {
    if (file.name.endsWith(".json")) {
      const isPath = await file.text().then(
        (text) => this.path.fromFile(parsed(text)),
        () => false,
      );
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
    const style = getComputedStyle(document.documentElement);
    const blob = await this.stage.picture((context) => {
      const { width, height } = context.canvas;
      const glow = context.createRadialGradient(
        width / 2,
        0.38 * height,
        0,
        width / 2,
        0.38 * height,
        0.75 * Math.max(width, height),
      );
      glow.addColorStop(0, style.getPropertyValue("--glow"));
      glow.addColorStop(1, style.getPropertyValue("--ground"));
      context.fillStyle = glow;
      context.fillRect(0, 0, width, height);
    });
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
    const statistics = mesh?.statistics;
    if (statistics) {
      const wanted = statistics.wantedBytes || 1;
      const missing = statistics.missingPages;
      const done = missing === 0 && statistics.triangles > 0;
      const here = Math.min(statistics.residentBytes / wanted, 1);
      this.progress.classList.toggle("done", done);
      this.progress.style.width = `${done ? 100 : 10 + 85 * here}%`;
      if (statistics.damagedPages > this.damagedShown) {
        this.damagedShown = statistics.damagedPages;
        const pages = statistics.damagedPages === 1 ? "A page" : `${statistics.damagedPages} pages`;
        this.notice.show(`${pages} of the file did not arrive whole: it stays coarse there.`, true);
      }
    }
    const now = performance.now();
    clearTimeout(this.counterTimer);
    const show = () => {
      this.lastCounters = performance.now();
      this.panel.showCounts(counts, statistics, mesh?.pages ?? new Uint8Array(0));
    };
    if (now - this.lastCounters > COUNTER_INTERVAL) show();
    else this.counterTimer = window.setTimeout(show, COUNTER_INTERVAL);
  }

  /** Allows more error while frames take too long, and less again when there is time. */
  private holdFrameRate(interval: number): void {
    if (interval <= 0 || interval > 1000) return;
    const wanted = 1000 / this.state.frameRate;
    const factor = interval > 1.25 * wanted ? 1.04 : interval < 1.05 * wanted ? 0.99 : 1;
    const pixels = Math.min(Math.max(this.state.pixelError * factor, 1), PIXELS.high);
    if (pixels === this.state.pixelError) return;
    this.state.pixelError = pixels;
    if (this.stage.meshes[0]) this.stage.meshes[0].pixelError = pixels;
    this.panel.update();
  }

  private pick(x: number, y: number): void {
    const found = this.stage.pick(x, y);
    this.letGo();
    if (!found) return;
    const { mesh, cluster, distance } = found;
    const tangent = Math.tan((this.stage.camera.fov * Math.PI) / 360);
    const pixelsPerUnit = this.stage.height / (2 * tangent * distance);
    this.card = pickedCard(mesh, cluster, pixelsPerUnit, () => this.letGo());
    this.root.append(this.card);
    this.stage.picked = cluster.cluster;
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
    this.listenToPointer(host);
    this.listenToDrops();
    addEventListener("keydown", (event) => this.onKey(event));
  }

  private listenToPointer(host: HTMLElement): void {
    let start: [number, number] | undefined;
    host.addEventListener("pointerdown", (event) => {
      start = event.button === 0 ? [event.clientX, event.clientY] : undefined;
      if (this.path.isReplaying) this.path.stop();
    });
    host.addEventListener("pointerup", (event) => {
      if (!start) return;
      const moved = Math.hypot(event.clientX - start[0], event.clientY - start[1]);
      if (moved < CLICK) this.pick(event.clientX, event.clientY);
      start = undefined;
    });
    this.divider.addEventListener("pointerdown", (event) =>
      this.divider.setPointerCapture(event.pointerId),
    );
    this.divider.addEventListener("pointermove", (event) => {
      if (!this.divider.hasPointerCapture(event.pointerId)) return;
      const { left, width } = host.getBoundingClientRect();
      this.state.wipe = Math.min(Math.max((event.clientX - left) / width, 0.02), 0.98);
      this.placeDivider();
    });
  }

  private listenToDrops(): void {
    addEventListener("dragover", (event) => {
      event.preventDefault();
      this.dropHint.hidden = false;
    });
    addEventListener("dragleave", (event) => {
      if (!event.relatedTarget) this.dropHint.hidden = true;
    });
    addEventListener("drop", (event) => {
      event.preventDefault();
      this.dropHint.hidden = true;
      const file = event.dataTransfer?.files[0];
      if (file)
        void this.take(file, this.state.layout !== "single" && event.clientX > innerWidth / 2);
    });
  }

  private onKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || this.help.open) return;
    if (event.target instanceof HTMLInputElement && event.target.type === "range") return;
    const action = this.keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    const look = (Object.keys(LOOKS) as Look[]).find((each) => LOOKS[each].key === event.key);
    if (look) {
      this.state.look = look;
      this.apply();
    } else if (action) action();
    else return;
    event.preventDefault();
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

function parsed(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    return undefined;
  }
}

function save(blob: Blob, name: string): void {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
