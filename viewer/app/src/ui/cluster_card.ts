// The numbers of a cluster that was clicked.

import { Vector3 } from "three";
import { digitsFor } from "../state";
import type { Picked } from "../viewport/viewport";
import { count, h, significant } from "./dom";

const NONE = 0xffffffff;

export function pickedCard(
  { mesh, cluster, distance, point }: Picked,
  pixelsPerUnit: number,
  close: () => void,
): HTMLElement {
  const size = cluster.box.getSize(new Vector3()).toArray().map(significant).join(" × ");
  const unit = unitOf(mesh.info.metadata);
  const named = mesh.materials.names[cluster.material];
  const pixels = (error: number) =>
    error === Infinity ? "" : ` (${significant(error * pixelsPerUnit)} px)`;
  const rows: [string, string][] = [
    ["Level", `${cluster.level} of ${mesh.info.levels - 1}`],
    ["Group", count(cluster.group)],
    [
      "Made from",
      cluster.generating === NONE ? "the source" : `group ${count(cluster.generating)}`,
    ],
    ["Triangles", count(cluster.triangles)],
    ["Vertices", count(cluster.vertices)],
    ["Error", significant(cluster.error) + pixels(cluster.error)],
    ["Once coarser", significant(cluster.groupError) + pixels(cluster.groupError)],
    ["Material", named || String(cluster.material)],
    ...(mesh.info.instances.length > 1
      ? ([["Instance", count(cluster.instance)]] as [string, string][])
      : []),
    ["Box", size],
    ["Point", place(point, distance) + unit],
  ];
  return h(
    "div",
    { className: "picked", id: "picked" },
    h(
      "header",
      {},
      h("h2", { textContent: `Cluster ${count(cluster.cluster)}` }),
      h("button", {
        type: "button",
        textContent: "×",
        title: "Let go (Esc)",
        onclick: close,
        aria: { label: "Let go" },
      }),
    ),
    h("dl", {}, ...rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)])),
  );
}

/** A place in the world, with digits down to about a thousandth of how far away it was seen. */
function place(point: readonly number[], distance: number): string {
  const digits = Math.max(digitsFor(distance) - 3, 0);
  return point.map((x) => x.toFixed(digits)).join(", ");
}

/** The unit of coordinates where the asset says one. */
function unitOf(metadata: Record<string, unknown>): string {
  const { coordinates } = metadata as { coordinates?: { unit?: unknown } };
  return typeof coordinates?.unit === "string" ? ` ${coordinates.unit}` : "";
}
