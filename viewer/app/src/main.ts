// The page: starts the viewer, or says why it cannot.

import { h } from "./dom";
import type { Viewer } from "./viewer";

declare global {
  interface Window {
    /** For tests and for whoever embeds the page. */
    umbelViewer?: Viewer;
  }
}

function say(root: HTMLElement, title: string, message: string): void {
  root.append(
    h("div", { className: "problem", role: "alert" }, h("h1", {}, title), h("p", {}, message)),
  );
}

async function main(): Promise<void> {
  const root = document.getElementById("app") as HTMLElement;
  const hasWebGL2 = document.createElement("canvas").getContext("webgl2") !== null;
  if (!hasWebGL2) {
    say(
      root,
      "This browser cannot show the model",
      "It needs WebGL 2, which this browser does not have or has turned off. A current Firefox, Chrome, Edge or Safari has it.",
    );
    return;
  }
  try {
    const { Viewer } = await import("./viewer");
    const viewer = new Viewer(root);
    window.umbelViewer = viewer;
    viewer.start();
  } catch (error) {
    say(root, "The viewer did not start", error instanceof Error ? error.message : String(error));
  }
}

void main();
