// The title: the asset's name, size and copyright.

import { jsonOf } from "umbel";
import type { UmbelMesh } from "umbel/three";
import { nameOf, type Source } from "../state";
import { count, h } from "./dom";

function numbered(number: number, of: string): string {
  return `${count(number)} ${of}${number === 1 ? "" : "s"}`;
}

/** Shows an asset's name, size and copyright, and sets the page's title. */
export function showTitle(element: HTMLElement, mesh: UmbelMesh, source: Source): void {
  const { instancedTriangles, sourceTriangles, levels, metadata, scene } = mesh.info;
  const name = typeof metadata.name === "string" && metadata.name ? metadata.name : nameOf(source);
  const { copyright } = jsonOf(scene.asset);
  // The header of an asset with a tree of instances does not count them.
  const triangles =
    instancedTriangles === undefined
      ? `${count(sourceTriangles)} triangles before instancing`
      : numbered(instancedTriangles, "triangle");
  document.title = `${name} – Umbel`;
  element.replaceChildren(
    h("h1", { textContent: name }),
    h("p", { textContent: `${triangles}, ${numbered(levels, "level")}` }),
  );
  if (typeof copyright === "string" && copyright)
    element.append(h("p", { className: "copyright", textContent: copyright }));
}
