// Selection of a cut: which groups must be refined, seen from a view, and so which clusters are
// drawn. The arithmetic is that of docs/lod.md, "to the last bit", in binary32.

import { NONE, type Tables } from "./tables.js";

export interface CameraView {
  kind: "camera";
  eye: readonly [number, number, number];
  threshold: number;
  /**
   * The view's volume: planes (x, y, z, w), inside where x px + y py + z pz + w >= 0. What is
   * outside may have `offscreen` times the error.
   */
  planes?: Float32Array;
  offscreen?: number;
}

export type View = { kind: "error"; error: number } | CameraView | { kind: "level"; level: number };

const f = Math.fround;
const LARGEST = f(3.4028234663852886e38);
const SMALLEST_SQUARE = 2 ** -100;
const UP = 2 ** 96;
const DOWN = 2 ** -96;

/** A view from a camera: errors of up to `pixelError` pixels are good enough. `fovY` in radians. */
export function cameraView(
  eye: readonly [number, number, number],
  fovY: number,
  height: number,
  pixelError: number,
): CameraView {
  const threshold = f((2 * f(pixelError) * Math.tan(0.5 * f(fovY))) / height);
  return { kind: "camera", eye: [f(eye[0]), f(eye[1]), f(eye[2])], threshold };
}

function lengthOf(x: number, y: number, z: number): number {
  const square = f(f(f(x * x) + f(y * y)) + f(z * z));
  if (square >= SMALLEST_SQUARE && square <= LARGEST) return f(Math.sqrt(square));
  const [scale, back] = square < SMALLEST_SQUARE ? [UP, DOWN] : [DOWN, UP];
  x = f(x * scale);
  y = f(y * scale);
  z = f(z * scale);
  return f(f(Math.sqrt(f(f(f(x * x) + f(y * y)) + f(z * z)))) * back);
}

/** Distance from a point to sphere `i`, 0 inside it. */
export function distanceOutside(
  sphere: Float32Array,
  i: number,
  x: number,
  y: number,
  z: number,
): number {
  const at = 4 * i;
  const dx = f(sphere[at] - x);
  const dy = f(sphere[at + 1] - y);
  const dz = f(sphere[at + 2] - z);
  return Math.max(f(Math.min(lengthOf(dx, dy, dz), LARGEST) - sphere[at + 3]), 0);
}

/** Whether sphere `i` lies outside one of the planes. */
export function isOutside(planes: Float32Array, sphere: Float32Array, i: number): boolean {
  const at = 4 * i;
  for (let p = 0; p < planes.length; p += 4) {
    const distance =
      planes[p] * sphere[at] +
      planes[p + 1] * sphere[at + 1] +
      planes[p + 2] * sphere[at + 2] +
      planes[p + 3];
    if (distance < -sphere[at + 3]) return true;
  }
  return false;
}

function tooLarge(sphere: Float32Array, i: number, error: number, view: View): boolean {
  if (error === Infinity) return true;
  if (view.kind === "error") return error > f(view.error);
  if (view.kind === "level") return true;
  const distance = distanceOutside(sphere, i, view.eye[0], view.eye[1], view.eye[2]);
  const isHidden = view.planes !== undefined && isOutside(view.planes, sphere, i);
  const threshold = isHidden ? view.threshold * (view.offscreen ?? 1) : view.threshold;
  return error > f(f(threshold) * distance);
}

/** Whether a group's simplified form is not good enough. */
export function mustRefine({ groups }: Pick<Tables, "groups">, group: number, view: View): boolean {
  const error = groups.error[group];
  if (view.kind === "level") return groups.level[group] >= view.level || error === Infinity;
  return tooLarge(groups.sphere, group, error, view);
}

/** Calls `found` with each group that must be refined, from the root of the hierarchy down. */
export function refinedGroups(
  tables: Pick<Tables, "groups" | "nodes">,
  view: View,
  found: (group: number) => void,
): void {
  const { nodes } = tables;
  const stack = nodes.count ? [0] : [];
  for (let n = stack.pop(); n !== undefined; n = stack.pop()) {
    const group = nodes.group[n];
    if (group !== NONE) {
      if (mustRefine(tables, group, view)) found(group);
    } else if (tooLarge(nodes.sphere, n, nodes.error[n], view)) {
      const first = nodes.firstChild[n];
      for (let i = nodes.childCount[n] - 1; i >= 0; --i) stack.push(first + i);
    }
  }
}

/** The clusters of the cut, rising: those whose group must be refined and generating group not. */
export function select(
  tables: Pick<Tables, "groups" | "nodes" | "clusters">,
  view: View,
): number[] {
  const refined = new Uint8Array(tables.groups.count);
  refinedGroups(tables, view, (group) => {
    refined[group] = 1;
  });
  return drawnClusters(tables, refined);
}

/** The clusters that are drawn when exactly these groups are refined. */
export function drawnClusters(
  { groups, clusters }: Pick<Tables, "groups" | "clusters">,
  refined: Uint8Array,
): number[] {
  const drawn: number[] = [];
  for (let g = 0; g < groups.count; ++g) {
    if (!refined[g]) continue;
    const end = groups.firstCluster[g] + groups.clusterCount[g];
    for (let c = groups.firstCluster[g]; c < end; ++c) {
      const generating = clusters.generating[c];
      if (generating === NONE || !refined[generating]) drawn.push(c);
    }
  }
  return drawn;
}
