// Selects a cut: which groups a view refines, and which clusters it culls. The arithmetic is that of
// docs/selection.md in binary32, equal to the library's to the last bit.

interface ViewVolume {
  /**
   * Planes (x, y, z, w) of the view volume: inside is x px + y py + z pz + w >= 0. Groups outside
   * may have `offscreen` times the error.
   */
  planes?: Float32Array;
  offscreen?: number;
}

export interface CameraView extends ViewVolume {
  kind: "camera";
  eye: readonly [number, number, number];
  threshold: number;
}

export interface ErrorView extends ViewVolume {
  kind: "error";
  error: number;
}

export type View = ErrorView | CameraView | { kind: "level"; level: number };

/** Spheres, four floats each: centre and radius. */
export type Spheres = Float32Array;

const f = Math.fround;
/** Squares outside of [SMALLEST_SQUARE, LARGEST] are computed again, scaled by UP or DOWN. */
const LARGEST = f(3.4028234663852886e38);
const SMALLEST_SQUARE = 2 ** -100;
const UP = 2 ** 96;
const DOWN = 2 ** -96;

/** A view from a camera that allows errors of `pixelError` pixels; `fovY` in radians. */
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
  const scale = square < SMALLEST_SQUARE ? UP : DOWN;
  const back = 1 / scale;
  x = f(x * scale);
  y = f(y * scale);
  z = f(z * scale);
  return f(f(Math.sqrt(f(f(f(x * x) + f(y * y)) + f(z * z)))) * back);
}

/** Distance from a point to sphere `i`; 0 inside it. */
export function distanceOutside(
  spheres: Spheres,
  i: number,
  eye: readonly [number, number, number],
): number {
  const at = 4 * i;
  const dx = f(spheres[at] - eye[0]);
  const dy = f(spheres[at + 1] - eye[1]);
  const dz = f(spheres[at + 2] - eye[2]);
  return Math.max(f(Math.min(lengthOf(dx, dy, dz), LARGEST) - spheres[at + 3]), 0);
}

/** Whether a group's simplified form is too coarse for a view. */
export function mustRefine(
  spheres: Spheres,
  i: number,
  error: number,
  level: number,
  view: View,
): boolean {
  if (error === Infinity) return true;
  if (view.kind === "level") return level >= view.level;
  return error > allowedError(spheres, i, view);
}

/** The error that a view allows at sphere `i`. */
function allowedError(spheres: Spheres, i: number, view: CameraView | ErrorView): number {
  const factor = factorOf(spheres, i, view);
  if (view.kind === "error") return f(view.error * factor);
  return f(f(view.threshold * factor) * distanceOutside(spheres, i, view.eye));
}

/** The factor on the error that a view allows at sphere `i`. */
export function factorOf(spheres: Spheres, i: number, view: CameraView | ErrorView): number {
  const isHidden = view.planes !== undefined && isSphereOutside(view.planes, spheres, i);
  return isHidden ? (view.offscreen ?? 1) : 1;
}

function side(planes: ArrayLike<number>, p: number, x: number, y: number, z: number): number {
  return f(f(f(f(planes[p] * x) + f(planes[p + 1] * y)) + f(planes[p + 2] * z)) + planes[p + 3]);
}

/** Whether sphere `i` lies outside one of the planes. */
export function isSphereOutside(planes: ArrayLike<number>, spheres: Spheres, i: number): boolean {
  const at = 4 * i;
  for (let p = 0; p < planes.length; p += 4)
    if (side(planes, p, spheres[at], spheres[at + 1], spheres[at + 2]) < -spheres[at + 3])
      return true;
  return false;
}

const NODE_SLACK = 2 ** -20;

/** Whether the sphere of an inner node lies so far outside that all below it does. */
export function isNodeOutside(planes: ArrayLike<number>, spheres: Spheres, i: number): boolean {
  const [x, y, z, radius] = spheres.subarray(4 * i, 4 * i + 4) as unknown as number[];
  for (let p = 0; p < planes.length; p += 4) {
    const [a, b, c, d] = [planes[p], planes[p + 1], planes[p + 2], planes[p + 3]];
    const size = f(
      f(f(Math.abs(f(a * x)) + Math.abs(f(b * y))) + Math.abs(f(c * z))) + Math.abs(d),
    );
    if (f(side(planes, p, x, y, z) + f(NODE_SLACK * size)) < -radius) return true;
  }
  return false;
}

/** How many times larger than a view allows an error is; 0 where it is small enough. */
export function timesTooLarge(spheres: Spheres, i: number, error: number, view: View): number {
  if (view.kind === "level") return 1;
  if (!mustRefine(spheres, i, error, 0, view)) return 0;
  const allowed = allowedError(spheres, i, view);
  return Math.min(error / Math.max(allowed, 1.1754943508222875e-38), 1e6);
}

/** Whether a box (lowest and highest corner) lies outside one of the planes. */
export function isBoxOutside(planes: ArrayLike<number>, box: ArrayLike<number>, at = 0): boolean {
  for (let p = 0; p < planes.length; p += 4) {
    const x = box[at + (planes[p] >= 0 ? 3 : 0)];
    const y = box[at + (planes[p + 1] >= 0 ? 4 : 1)];
    const z = box[at + (planes[p + 2] >= 0 ? 5 : 2)];
    if (side(planes, p, x, y, z) < 0) return true;
  }
  return false;
}

/** A cluster's sphere (centre, radius) and normal cone (axis, cutoff). */
export interface NormalCone {
  sphere: readonly [number, number, number, number];
  axis: readonly [number, number, number];
  cutoff: number;
}

/** Whether all triangles of a cluster face away from a point. */
export function isBackfacing(
  { sphere, axis, cutoff }: NormalCone,
  eye: readonly number[],
): boolean {
  const x = f(sphere[0] - eye[0]);
  const y = f(sphere[1] - eye[1]);
  const z = f(sphere[2] - eye[2]);
  const along = f(f(f(x * axis[0]) + f(y * axis[1])) + f(z * axis[2]));
  return along >= f(f(cutoff * lengthOf(x, y, z)) + sphere[3]);
}
