// The view modes: each tints the clusters by one of their properties.

import type { ClusterInfo, TintFunction, UmbelMesh } from "umbel/three";

export type ViewMode = "shaded" | "clusters" | "groups" | "levels" | "error" | "overlap" | "pages";

export interface ViewModeInfo {
  name: string;
  about: string;
  key: string;
}

const ABOUT: Record<ViewMode, string> = {
  shaded: "The surface with its materials.",
  clusters: "One colour for each cluster.",
  groups: "One colour for clusters that are exchanged together.",
  levels: "From the finest level to the coarsest.",
  error: "How far each cluster may be from the full mesh.",
  overlap: "The clusters’ boxes: the denser, the more overlap.",
  pages: "Where finer clusters are still to arrive.",
};

/** In the order of their keys, 1 to 7. */
export const VIEW_MODES = Object.fromEntries(
  Object.entries(ABOUT).map(([mode, about], i) => [
    mode,
    { name: mode[0].toUpperCase() + mode.slice(1), about, key: String(i + 1) },
  ]),
) as Record<ViewMode, ViewModeInfo>;

type Rgb = readonly [number, number, number];

/** A colour scale from fine to coarse, in equal steps of lightness. */
const SCALE: readonly Rgb[] = [
  [0.27, 0.2, 0.5],
  [0.21, 0.41, 0.64],
  [0.16, 0.6, 0.62],
  [0.42, 0.76, 0.47],
  [0.82, 0.83, 0.36],
  [0.96, 0.64, 0.35],
];

export function scaleColor(t: number): Rgb {
  const at = Math.min(Math.max(t, 0), 1) * (SCALE.length - 1);
  const i = Math.min(Math.floor(at), SCALE.length - 2);
  const f = at - i;
  const [a, b] = [SCALE[i], SCALE[i + 1]];
  return [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2])];
}

export function scaleGradient(): string {
  const stops = SCALE.map((c) => `rgb(${c.map((x) => Math.round(255 * x)).join(" ")})`);
  return `linear-gradient(to right, ${stops.join(", ")})`;
}

/** A colour for a number, by the golden angle: consecutive numbers get different hues. */
function numberColor(n: number): Rgb {
  const hue = (n * 0.618034) % 1;
  const light = 0.62 + 0.16 * ((n * 0.7548777) % 1);
  const channel = (shift: number) => {
    const k = (hue * 12 + shift) % 12;
    return light - 0.17 * Math.max(-1, Math.min(k - 3, 9 - k, 1));
  };
  return [channel(0), channel(8), channel(4)];
}

/** Odd levels are paler, to separate neighbours. */
function levelColor(level: number, levels: number): Rgb {
  const [r, g, b] = scaleColor(level / Math.max(levels - 1, 1));
  const pale = level % 2 ? 0.22 : 0;
  return [r + pale * (1 - r), g + pale * (1 - g), b + pale * (1 - b)];
}

const RESIDENT: Rgb = [0.29, 0.62, 0.6];
const PENDING: Rgb = [0.95, 0.68, 0.28];
const PICKED: Rgb = [1, 0.42, 0.24];

function opaque(rgb: Rgb): readonly [number, number, number, number] {
  return [rgb[0], rgb[1], rgb[2], 1];
}

/** The logarithm of an error on a scale of four decades that ends at the largest one. */
function errorFraction(error: number, coarsest: number): number {
  return error <= 0 ? 0 : 1 + Math.log10(error / coarsest) / 4;
}

function modeTint(mode: ViewMode, mesh: UmbelMesh): TintFunction | undefined {
  const { levels } = mesh.info;
  switch (mode) {
    case "clusters":
      return ({ cluster }) => opaque(numberColor(cluster));
    case "groups":
      return ({ group }) => opaque(numberColor(group));
    case "levels":
      return ({ level }) => opaque(levelColor(level, levels));
    case "error":
      return ({ error }) => opaque(scaleColor(errorFraction(error, mesh.coarsestError)));
    case "pages":
      return ({ isPending }) => opaque(isPending ? PENDING : RESIDENT);
    default:
      return undefined;
  }
}

/** The tint of a mode, with one cluster highlighted. */
export function tintOf(
  mode: ViewMode,
  mesh: UmbelMesh,
  picked: number | undefined,
): TintFunction | undefined {
  const tint = modeTint(mode, mesh);
  if (picked === undefined) return tint;
  return (cluster: ClusterInfo) =>
    cluster.cluster === picked ? opaque(PICKED) : (tint?.(cluster) ?? [0, 0, 0, 0]);
}

export interface Legend {
  low: string;
  high: string;
}

export function legendOf(mode: ViewMode): Legend | undefined {
  if (mode === "levels") return { low: "fine", high: "coarse" };
  if (mode === "error") return { low: "exact", high: "far off" };
  return undefined;
}
