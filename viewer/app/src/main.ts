// The page: shows a preview as soon as possible, then loads the viewer; or says why it cannot.

import { AssetStream } from "umbel";
import { PreviewRenderer } from "./preview/preview_renderer";
import { type CameraPose, defaultState, nameOf, readLink, type State } from "./state";
import { h } from "./ui/dom";
import { LOST } from "./ui/texts";
import { applyTheme } from "./ui/theme";

/** Milliseconds that the viewer waits for the preview, at most. */
const MAX_WAIT = 3000;

function showError(root: HTMLElement, title: string, message: string): void {
  root.append(
    h(
      "div",
      { className: "error-card", role: "alert" },
      h("h1", {}, title),
      h("p", {}, message),
      h("button", { type: "button", onclick: () => location.reload() }, "Try again"),
    ),
  );
}

/** Shows a preview, which does not need three.js, and waits for its first picture. */
async function showPreview(
  root: HTMLElement,
  stream: Promise<AssetStream>,
  pose: CameraPose | undefined,
  state: State,
): Promise<PreviewRenderer | undefined> {
  try {
    const preview = new PreviewRenderer(root, await stream, pose, state.pixelError);
    await Promise.race([preview.isShown, new Promise((late) => setTimeout(late, MAX_WAIT))]);
    return preview;
  } catch {
    return undefined; // the viewer reports the error
  }
}

async function main(): Promise<void> {
  const root = document.getElementById("app") as HTMLElement;
  applyTheme();
  const state = defaultState();
  const pose = readLink(location.hash, state);
  if (matchMedia("(max-width: 700px)").matches) root.classList.add("panel-hidden");
  const search = new URLSearchParams(location.search);
  const asset = search.get("asset") || document.body.dataset.asset;
  const title = h("div", { className: "title" });
  const progress = h("p", { role: "status" }, "Opening …");
  if (asset) title.append(h("h1", {}, nameOf(asset)), progress);
  root.append(title);
  const onConnection = (isLost: boolean) => {
    progress.textContent = isLost ? LOST : "Opening …";
  };
  const early = asset ? AssetStream.open(asset, { budget: state.budget }, onConnection) : undefined;
  const preview =
    early && state.layout === "single" ? await showPreview(root, early, pose, state) : undefined;
  try {
    const { Viewer } = await import("./viewer");
    title.remove();
    const viewer = new Viewer(root, state);
    // For tests, and for pages that embed the viewer.
    Object.assign(globalThis, { umbelViewer: viewer });
    viewer.start(asset, { pose, early, preview });
  } catch (error) {
    const hasWebGL2 = document.createElement("canvas").getContext("webgl2") !== null;
    root.replaceChildren();
    if (hasWebGL2)
      showError(
        root,
        "The viewer did not start",
        error instanceof Error ? error.message : String(error),
      );
    else
      showError(
        root,
        "This browser cannot show the model",
        "It needs WebGL 2, which this browser does not have or has turned off. A current Firefox, Chrome, Edge or Safari has it.",
      );
  }
}

void main();
