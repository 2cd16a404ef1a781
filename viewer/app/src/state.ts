// The settings of the viewer, and how a link encodes them.

import type { ViewMode } from "./viewport/view_modes";
import { VIEW_MODES } from "./viewport/view_modes";

export type Layout = "single" | "side" | "wipe";

export interface State {
  viewMode: ViewMode;
  wireframe: boolean;
  pixelError: number;
  /** Frames a second to hold by adapting the pixel error; 0 for a fixed pixel error. */
  frameRate: number;
  frozen: boolean;
  /** Bytes of memory for geometry and textures. */
  budget: number;
  layout: Layout;
  /** Position of the wipe, from 0 (left) to 1. */
  wipe: number;
}

/** An asset's address, or a local file. */
export type Source = string | File;

export function nameOf(source: Source): string {
  if (typeof source !== "string") return source.name;
  try {
    const path = new URL(source, document.baseURI).pathname;
    return decodeURIComponent(path.slice(path.lastIndexOf("/") + 1)) || source;
  } catch {
    return source; // no address, or a % that encodes nothing
  }
}

export interface CameraPose {
  position: [number, number, number];
  target: [number, number, number];
}

/** The asset to compare with that the page's address names. */
export function comparedAddress(): string | undefined {
  return new URLSearchParams(location.search).get("compare") || undefined;
}

export function defaultState(): State {
  const isSmall = matchMedia("(max-width: 700px)").matches;
  return {
    viewMode: "shaded",
    wireframe: false,
    pixelError: 1,
    frameRate: 0,
    frozen: false,
    budget: (isSmall ? 128 : 512) * 2 ** 20,
    layout: comparedAddress() ? "wipe" : "single",
    wipe: 0.5,
  };
}

/** Decimals that resolve a millionth of `length`. */
export function digitsFor(length: number): number {
  return Math.min(Math.max(6 - Math.floor(Math.log10(length || 1)), 0), 30);
}

/** The part of a link after #. */
export function writeLink(state: State, pose: CameraPose): string {
  const link = new URLSearchParams();
  const digits = digitsFor(Math.hypot(...pose.position.map((x, i) => x - pose.target[i])));
  const round = (numbers: readonly number[]) =>
    numbers.map((n) => Number(n.toFixed(digits))).join(",");
  link.set("eye", round(pose.position));
  link.set("target", round(pose.target));
  link.set("mode", state.viewMode);
  link.set("pixels", String(Number(state.pixelError.toPrecision(4))));
  if (state.wireframe) link.set("wireframe", "1");
  if (state.frameRate) link.set("fps", String(state.frameRate));
  if (state.layout !== defaultState().layout) link.set("layout", state.layout);
  if (state.layout === "wipe") link.set("wipe", state.wipe.toFixed(3));
  if (state.budget !== defaultState().budget)
    link.set("budget", String(Number((state.budget / 2 ** 20).toPrecision(4))));
  return link.toString().replaceAll("%2C", ",");
}

/** Whether a value is a point that a camera can be at: squares of such coordinates are finite. */
export function isPoint(value: unknown): value is [number, number, number] {
  const isCoordinate = (x: unknown) => typeof x === "number" && Math.abs(x) <= MAX_COORDINATE;
  return Array.isArray(value) && value.length === 3 && value.every(isCoordinate);
}

function pointOf(text: string | null): [number, number, number] | undefined {
  const point = (text ?? "").split(",").map((part) => (part.trim() ? Number(part) : Number.NaN));
  return isPoint(point) ? point : undefined;
}

export function readLink(hash: string, state: State): CameraPose | undefined {
  const link = new URLSearchParams(hash.replace(/^#/, ""));
  const mode = link.get("mode");
  if (mode && Object.hasOwn(VIEW_MODES, mode)) state.viewMode = mode as ViewMode;
  const pixels = Number(link.get("pixels"));
  if (pixels > 0) state.pixelError = Math.min(Math.max(pixels, PIXELS.low), PIXELS.high);
  state.wireframe = link.get("wireframe") === "1";
  const fps = Number(link.get("fps"));
  if (fps > 0) state.frameRate = Math.min(fps, 240);
  const layout = link.get("layout");
  if (layout === "single" || layout === "side" || layout === "wipe") state.layout = layout;
  const wipe = Number(link.get("wipe"));
  if (wipe > 0 && wipe < 1) state.wipe = wipe;
  const budget = Number(link.get("budget"));
  if (budget > 0) state.budget = Math.min(Math.max(budget * 2 ** 20, BUDGETS.low), BUDGETS.high);
  const position = pointOf(link.get("eye"));
  const target = pointOf(link.get("target"));
  // A camera at its target looks nowhere.
  if (!position || !target || position.every((x, i) => x === target[i])) return undefined;
  return { position, target };
}

/** Limit of canvas pixels for each pixel of the page. */
export const MAX_PIXEL_RATIO = 2;
const MAX_COORDINATE = 1e30;
/** The range of the pixel error. */
export const PIXELS = { low: 0.25, high: 64 };
/** The range of the budget, in bytes. */
export const BUDGETS = { low: 2 ** 22, high: 2 ** 31 };
