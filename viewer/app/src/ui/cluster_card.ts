// The card of a picked cluster.

import { Vector3 } from "three";
import { digitsFor } from "../state";
import type { PickedCluster } from "../viewport/viewport";
import { count, h, significant } from "./dom";

const NONE = 0xffffffff;

export function clusterCard(
  { mesh, cluster, distance, point }: PickedCluster,
  pixelsPerUnit: number,
  close: () => void,
): HTMLElement {
  // Lengths are those of the instance.
  const scale = new Vector3().setFromMatrixScale(cluster.matrix);
  const size = cluster.box.getSize(new Vector3()).multiply(scale).toArray();
  const unit = unitOf(mesh.info.metadata);
  const named = mesh.materials.names[cluster.material];
  const scaled = (meshError: number) => {
    const error = meshError * Math.max(...scale);
    const pixels = error === Infinity ? "" : ` (${significant(error * pixelsPerUnit)} px)`;
    return significant(error) + pixels;
  };
  const rows: [string, string][] = [
    ["Level", `${cluster.level} of ${mesh.info.levels - 1}`],
    ["Group", count(cluster.group)],
    [
      "Made from",
      cluster.generating === NONE ? "the source mesh" : `group ${count(cluster.generating)}`,
    ],
    ["Triangles", count(cluster.triangles)],
    ["Vertices", count(cluster.vertices)],
    ["Error", scaled(cluster.error)],
    ["Group error", scaled(cluster.groupError)],
    ["Material", named || String(cluster.material)],
    ...(mesh.info.instances.length > 1
      ? ([["Instance", count(cluster.instance)]] as [string, string][])
      : []),
    ["Box", size.map(significant).join(" × ")],
    ["Point", formatPoint(point, distance) + unit],
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
        title: "Close (Esc)",
        onclick: close,
        aria: { label: "Close" },
      }),
    ),
    h("dl", {}, ...rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)])),
  );
}

/** A point in the world, with decimals that resolve about a thousandth of its distance. */
function formatPoint(point: readonly number[], distance: number): string {
  const digits = Math.max(digitsFor(distance) - 3, 0);
  return point.map((x) => x.toFixed(digits)).join(", ");
}

/** The unit of coordinates, if the asset states one. */
function unitOf(metadata: Record<string, unknown>): string {
  const { coordinates } = metadata as { coordinates?: { unit?: unknown } };
  return typeof coordinates?.unit === "string" ? ` ${coordinates.unit}` : "";
}
