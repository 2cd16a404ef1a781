// The page: the first picture as soon as may be, then the viewer; or why it cannot be shown.

import { AssetStream } from "umbel";
import { Sketch } from "./preview/preview_renderer";
import { type CameraPose, defaultState, nameOf, readLink, type State } from "./state";
import { h } from "./ui/dom";
import { applyTheme } from "./ui/theme";

/** The viewer comes after the first picture, or after so many milliseconds without one. */
const PATIENCE = 3000;

function say(root: HTMLElement, title: string, message: string): void {
  root.append(
    h("div", { className: "problem", role: "alert" }, h("h1", {}, title), h("p", {}, message)),
  );
}

/** A picture without three.js, where one picture of one asset is wanted. */
async function sketch(
  root: HTMLElement,
  stream: Promise<AssetStream>,
  pose: CameraPose | undefined,
  state: State,
): Promise<Sketch | undefined> {
  try {
    const sketch = new Sketch(root, await stream, pose, state.pixelError);
    await Promise.race([sketch.isSeen, new Promise((late) => setTimeout(late, PATIENCE))]);
    return sketch;
  } catch {
    return undefined; // the viewer says what was wrong
  }
}

async function main(): Promise<void> {
  const root = document.getElementById("app") as HTMLElement;
  applyTheme();
  const state = defaultState();
  const pose = readLink(location.hash, state);
  if (matchMedia("(max-width: 700px)").matches) root.classList.add("plain");
  const search = new URLSearchParams(location.search);
  const asset = search.get("asset") ?? document.body.dataset.asset;
  const title = h("div", { className: "title" });
  if (asset) title.append(h("h1", {}, nameOf(asset)), h("p", {}, "Opening …"));
  root.append(title);
  const early = asset ? AssetStream.open(asset, { budget: state.budget }) : undefined;
  const isSingle = state.layout === "single" && !search.has("compare");
  const first = early && isSingle ? await sketch(root, early, pose, state) : undefined;
  try {
    const { Viewer } = await import("./viewer");
    title.remove();
    const viewer = new Viewer(root, state);
    // For tests, and for whoever embeds the page.
    Object.assign(globalThis, { umbelViewer: viewer });
    viewer.start(asset, { pose, early, sketch: first });
  } catch (error) {
    const hasWebGL2 = document.createElement("canvas").getContext("webgl2") !== null;
    root.replaceChildren();
    if (hasWebGL2)
      say(root, "The viewer did not start", error instanceof Error ? error.message : String(error));
    else
      say(
        root,
        "This browser cannot show the model",
        "It needs WebGL 2, which this browser does not have or has turned off. A current Firefox, Chrome, Edge or Safari has it.",
      );
  }
}

void main();
