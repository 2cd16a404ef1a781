// The viewer: opens assets, and connects the viewport with the panel, the keys and the messages.

import { type AssetStream, UmbelError } from "umbel";
import type { UmbelMesh } from "umbel/three";
import { AssetLoader } from "./asset_loader";
import { CameraRecorder } from "./camera_recorder";
import { Comparison } from "./comparison";
import { paintBackground, save } from "./files";
import { adaptedPixelError } from "./frame_rate";
import { HELD_KEYS, type KeyActions, keyBindings } from "./key_bindings";
import type { PreviewRenderer } from "./preview/preview_renderer";
import {
  type CameraPose,
  comparedAddress,
  defaultState,
  type Layout,
  nameOf,
  readLink,
  type Source,
  type State,
  writeLink,
} from "./state";
import { clusterCard } from "./ui/cluster_card";
import { h } from "./ui/dom";
import { listenToDrops, listenToKeys, listenToPointer } from "./ui/input";
import { ErrorCard, helpDialog, Notice, titleOf } from "./ui/messages";
import { Panel } from "./ui/panel";
import { Progress } from "./ui/progress";
import { applyTheme, toggleTheme } from "./ui/theme";
import { showTitle } from "./ui/title";
import { type FrameCounts, Viewport } from "./viewport/viewport";

interface Opening {
  pose?: CameraPose | undefined;
  /** A stream of the asset that is open or opening already. */
  early?: Promise<AssetStream> | undefined;
  /** Shown until the viewport draws. */
  preview?: PreviewRenderer | undefined;
}

export class Viewer {
  readonly viewport: Viewport;
  private readonly panel: Panel;
  private readonly loader: AssetLoader;
  private readonly comparison: Comparison;
  private readonly recorder: CameraRecorder;
  private readonly error = new ErrorCard();
  private readonly notice = new Notice();
  private readonly help = helpDialog();
  private readonly title = h("div", { className: "title" });
  private readonly progress = new Progress((counts, meshes) =>
    this.panel.showCounts(counts, meshes),
  );
  private readonly dropHint = h(
    "div",
    { className: "drop", hidden: true },
    "Drop an .umbel file here",
  );
  private readonly fileInput = h("input", { type: "file", accept: ".umbel,.json", hidden: true });
  private readonly panelButton: HTMLButtonElement;
  private card: HTMLElement | undefined;
  private preview: PreviewRenderer | undefined;
  private source: Source | undefined;
  /** Whether the file to be chosen is compared with the asset. */
  private choosesOther = false;
  /** Number of assets opened so far: an older one that arrives late is dropped. */
  private openings = 0;
  /** Damaged pages that were reported. */
  private readonly reportedDamage = new WeakMap<UmbelMesh, number>();

  constructor(
    private readonly root: HTMLElement,
    readonly state: State,
  ) {
    const host = h("div", { className: "viewport" });
    const actions = this.actions();
    this.panel = new Panel(state, actions);
    this.panelButton = h("button", {
      className: "panel-button",
      type: "button",
      textContent: "Settings",
      onclick: actions.togglePanel,
      aria: { controls: "panel", expanded: String(!root.classList.contains("panel-hidden")) },
    });
    root.append(
      host,
      this.progress.element,
      this.title,
      this.panel.element,
      this.panelButton,
      this.notice.element,
      this.error.element,
      this.dropHint,
      this.fileInput,
      this.help,
    );
    this.viewport = new Viewport(host, state);
    this.loader = new AssetLoader(state, this.panel, this.notice);
    this.comparison = new Comparison(host, state, this.viewport, this.loader, this.notice);
    this.recorder = new CameraRecorder(this.panel, this.notice);
    this.viewport.onFrame = (counts) => this.onFrame(counts);
    this.viewport.onMeshes = (meshes) => {
      this.loader.setMeshes(meshes);
      const { picked } = this.viewport;
      if (picked && !meshes.includes(picked.mesh)) this.deselect();
    };
    this.viewport.onContext = (isLost) => {
      const text = "The browser took the GPU away: the picture waits for it.";
      this.notice.keep(this.viewport, isLost ? text : undefined);
    };
    this.viewport.beforeFrame = (time) => this.recorder.beforeFrame(time, this.viewport.camera);
    this.listen(host, actions);
  }

  /** What the panel and the keys do. */
  private actions(): KeyActions {
    return {
      change: () => this.apply(),
      setBudget: (bytes) => this.setBudget(bytes),
      setLayout: (layout) => void this.setLayout(layout),
      chooseOther: () => this.chooseFile(true),
      frameAll: () => this.viewport.frameAll(),
      share: () => void this.share(),
      screenshot: () => void this.screenshot(),
      record: () => {
        this.recorder.toggleRecording();
        this.viewport.requestFrame();
      },
      replay: () => {
        this.recorder.toggleReplay();
        this.viewport.requestFrame();
      },
      savePath: () => this.recorder.savePath(),
      help: () => this.help.showModal(),
      open: () => this.chooseFile(false),
      theme: () => {
        toggleTheme();
        this.viewport.apply();
      },
      togglePanel: () => {
        const isHidden = this.root.classList.toggle("panel-hidden");
        this.panelButton.setAttribute("aria-expanded", String(!isHidden));
      },
      deselect: () => {
        if (this.viewport.meshes[0]) this.error.hide();
        this.deselect();
      },
    };
  }

  private listen(host: HTMLElement, actions: KeyActions): void {
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => {
      applyTheme();
      this.viewport.apply();
    });
    addEventListener("hashchange", () => void this.followLink());
    this.fileInput.onchange = () => {
      const file = this.fileInput.files?.[0];
      if (file) void this.openFile(file, this.choosesOther);
    };
    listenToPointer(host, {
      down: () => this.recorder.stopReplay(),
      click: (x, y) => this.pick(x, y),
    });
    listenToDrops(this.dropHint, (file, x, count) => {
      void this.openFile(file, this.viewport.sideOf(x) === 1);
      if (count > 1) this.notice.show(`Of ${count} files only ${file.name} is opened.`);
    });
    const bindings = keyBindings(this.state, this.viewport.camera, actions);
    listenToKeys((key, isRepeated) => {
      const action = this.help.open ? undefined : bindings[key];
      if (!isRepeated || HELD_KEYS.has(key)) action?.();
      return action !== undefined;
    });
  }

  /** Shows the asset that the page's address names. */
  start(asset: string | undefined, opening: Opening): void {
    this.comparison.other = comparedAddress();
    this.panel.update();
    if (!asset) {
      this.error.show(
        "Nothing to show yet",
        "Drop an .umbel file here, choose one, or add ?asset=ADDRESS to this page’s address.",
        [{ text: "Choose a file", action: () => this.chooseFile(false) }],
      );
      return;
    }
    void this.open(asset, opening);
  }

  async open(source: Source, { pose, early, preview }: Opening = {}): Promise<void> {
    const opening = ++this.openings;
    this.preview = preview;
    this.error.hide();
    this.notice.end();
    this.deselect();
    this.title.replaceChildren(h("h1", { textContent: nameOf(source) }), h("p", {}, "Opening …"));
    this.progress.begin();
    try {
      const mesh = await this.loader.load(source, this.state.pixelError, early);
      if (opening !== this.openings) return mesh.dispose();
      this.source = source;
      // What was frozen is the cut of the asset before.
      this.state.frozen = false;
      this.comparison.setSource(source);
      this.viewport.setMesh(0, mesh);
      if (pose) this.viewport.camera.setPose(pose);
      else this.viewport.frameAll();
      showTitle(this.title, mesh, source);
      await this.setLayout(this.state.layout);
    } catch (error) {
      if (opening === this.openings) this.fail(error, source, pose);
    }
  }

  private fail(error: unknown, source: Source, pose: CameraPose | undefined): void {
    this.removePreview();
    this.title.replaceChildren();
    this.progress.end();
    const choices = [
      { text: "Try again", action: () => void this.open(source, { pose }) },
      { text: "Open another file", action: () => this.chooseFile(false) },
    ];
    // The asset before is still there.
    const [mesh] = this.viewport.meshes;
    if (mesh && this.source) {
      showTitle(this.title, mesh, this.source);
      choices.push({ text: "Close", action: () => this.error.hide() });
    }
    const isUnread =
      error instanceof UmbelError && error.kind === "network" && source instanceof File;
    this.error.show(
      isUnread ? "Not readable" : titleOf(error instanceof UmbelError ? error.kind : "unsupported"),
      error instanceof Error ? error.message : String(error),
      choices,
    );
  }

  private chooseFile(isOther: boolean): void {
    this.choosesOther = isOther;
    this.fileInput.value = "";
    this.fileInput.click();
  }

  /** Opens a local file: a camera path, the asset to compare with, or the asset to show. */
  private async openFile(file: File, isOther: boolean): Promise<void> {
    if (/\.json$/i.test(file.name)) await this.recorder.openPath(file);
    else if (isOther) {
      await this.comparison.setOther(file);
      this.apply();
    } else await this.open(file);
  }

  private apply(): void {
    this.panel.update();
    this.viewport.apply();
  }

  private setBudget(bytes: number): void {
    this.state.budget = bytes;
    for (const mesh of this.viewport.meshes) mesh?.setBudget(bytes);
    this.panel.update();
    this.viewport.requestFrame();
  }

  private async setLayout(layout: Layout): Promise<void> {
    await this.comparison.setLayout(layout);
    this.apply();
  }

  /** Shows the view of the link in the address bar. */
  private async followLink(): Promise<void> {
    Object.assign(this.state, defaultState());
    const pose = readLink(location.hash, this.state);
    this.setBudget(this.state.budget);
    await this.setLayout(this.state.layout);
    if (pose) this.viewport.camera.setPose(pose);
    this.viewport.requestFrame();
  }

  /** Puts a link to the current view into the clipboard and the address bar. */
  private async share(): Promise<void> {
    const address = new URL(location.href);
    address.hash = writeLink(this.state, this.viewport.camera.pose);
    history.replaceState(null, "", address);
    const isCopied = await navigator.clipboard?.writeText(address.href).then(
      () => true,
      () => false,
    );
    const isSplit = this.state.layout !== "single";
    const hasLocal =
      typeof this.source !== "string" || (isSplit && this.comparison.other instanceof File);
    this.notice.show(
      hasLocal
        ? "The link has the view, but a file of this device cannot be in it."
        : isCopied
          ? "Link copied."
          : window === top
            ? "The link is in the address bar."
            : "The page around the viewer does not let it copy links.",
    );
  }

  private async screenshot(): Promise<void> {
    const blob = await this.viewport.picture((context) => paintBackground(context));
    save(blob, `${document.title.split(" – ")[0]}.png`);
  }

  private removePreview(): void {
    this.preview?.dispose();
    this.preview = undefined;
  }

  private onFrame(counts: FrameCounts): void {
    if (counts.triangles > 0) this.removePreview();
    if (this.state.frameRate > 0) this.holdFrameRate(counts.interval);
    this.progress.update(counts, this.viewport.meshes);
    this.loader.update();
    for (const mesh of this.viewport.meshes) if (mesh) this.reportDamage(mesh);
  }

  private reportDamage(mesh: UmbelMesh): void {
    const damaged = mesh.statistics?.damagedPages ?? 0;
    if (damaged <= (this.reportedDamage.get(mesh) ?? 0)) return;
    this.reportedDamage.set(mesh, damaged);
    const pages = damaged === 1 ? "A page" : `${damaged} pages`;
    const file = mesh === this.viewport.meshes[0] ? "the file" : "the file on the right";
    this.notice.keep(mesh, `${pages} of ${file} did not arrive whole: it stays coarse there.`);
  }

  private holdFrameRate(interval: number): void {
    const pixels = adaptedPixelError(this.state.pixelError, this.state.frameRate, interval);
    if (pixels === this.state.pixelError) return;
    this.state.pixelError = pixels;
    this.panel.update();
  }

  /** Picks the cluster at a point of the page, highlights it, and shows its card. */
  private pick(x: number, y: number): void {
    const found = this.viewport.pick(x, y);
    this.deselect();
    if (!found) return;
    const tangent = Math.tan((this.viewport.camera.perspective.fov * Math.PI) / 360);
    const pixelsPerUnit = this.viewport.height / (2 * tangent * found.distance);
    this.card = clusterCard(found, pixelsPerUnit, () => this.deselect());
    this.root.append(this.card);
    this.viewport.picked = { mesh: found.mesh, cluster: found.cluster.cluster };
    this.viewport.apply();
  }

  private deselect(): void {
    this.card?.remove();
    this.card = undefined;
    if (this.viewport?.picked === undefined) return;
    this.viewport.picked = undefined;
    this.viewport.apply();
  }
}
