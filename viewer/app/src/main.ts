// The page: starts the viewer, or says why it cannot.

import { AssetStream } from "umbel";
import { h } from "./dom";
import { defaultState, readLink } from "./state";

function say(root: HTMLElement, title: string, message: string): void {
  root.append(
    h("div", { className: "problem", role: "alert" }, h("h1", {}, title), h("p", {}, message)),
  );
}

async function main(): Promise<void> {
  const root = document.getElementById("app") as HTMLElement;
  const state = defaultState();
  const pose = readLink(location.hash, state);
  // The asset is on its way while the rest of the program is.
  const asset = new URLSearchParams(location.search).get("asset") ?? document.body.dataset.asset;
  const early = asset && AssetStream.open(asset, { budget: state.budget });
  if (early) early.catch(() => {}); // the viewer says what was wrong
  try {
    const { Viewer } = await import("./viewer");
    const viewer = new Viewer(root, state);
    // For tests, and for whoever embeds the page.
    Object.assign(globalThis, { umbelViewer: viewer });
    viewer.start(asset, { pose, early: early || undefined });
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
