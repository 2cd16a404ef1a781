// An instance of a mesh: how much its transform changes lengths, and views as the mesh sees them.
// Transforms are three rows of four, in an array from an index on.

import type { CameraView, View } from "./select.js";

type Rows = ArrayLike<number>;

/** The least and the largest factor by which a transform changes lengths: its singular values. */
export function stretchOf(m: Rows, at: number): [number, number] {
  const column = (j: number) => [m[at + j], m[at + 4 + j], m[at + 8 + j]] as const;
  const [a, b, c] = [column(0), column(1), column(2)];
  const [aa, bb, cc] = [dot(a, a), dot(b, b), dot(c, c)];
  const [ab, ac, bc] = [dot(a, b), dot(a, c), dot(b, c)];
  const off = ab * ab + ac * ac + bc * bc;
  const mean = (aa + bb + cc) / 3;
  if (off <= 1e-14 * mean * mean)
    return [Math.sqrt(Math.min(aa, bb, cc)), Math.sqrt(Math.max(aa, bb, cc))];
  // The eigenvalues of a symmetric matrix of three rows, by Smith's trigonometric solution (1961).
  const [x, y, z] = [aa - mean, bb - mean, cc - mean];
  const p = Math.sqrt((x * x + y * y + z * z + 2 * off) / 6);
  const determinant = x * (y * z - bc * bc) - ab * (ab * z - bc * ac) + ac * (ab * bc - y * ac);
  const angle = Math.acos(Math.min(Math.max(determinant / (2 * p ** 3), -1), 1)) / 3;
  const most = mean + 2 * p * Math.cos(angle);
  const least = mean + 2 * p * Math.cos(angle + (2 * Math.PI) / 3);
  return [Math.sqrt(Math.max(least, 0)), Math.sqrt(most)];
}

function dot(a: readonly number[], b: readonly number[]): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** Writes the sphere about a box under a transform: centre and radius. */
export function placedSphere(
  low: ArrayLike<number>,
  high: ArrayLike<number>,
  m: Rows,
  at: number,
  out: Float32Array,
  outAt: number,
): void {
  const isEmpty = low[0] > high[0];
  const middle = [0, 1, 2].map((j) => (isEmpty ? 0 : 0.5 * (low[j] + high[j])));
  const half = [0, 1, 2].map((j) => (isEmpty ? 0 : 0.5 * (high[j] - low[j])));
  for (let i = 0; i < 3; ++i) {
    const row = at + 4 * i;
    out[outAt + i] =
      m[row + 3] + m[row] * middle[0] + m[row + 1] * middle[1] + m[row + 2] * middle[2];
  }
  let most = 0;
  for (let k = 0; k < 4; ++k) {
    let square = 0;
    for (let i = 0; i < 3; ++i) {
      const row = at + 4 * i;
      const side = k & 1 ? m[row + 1] * half[1] : -m[row + 1] * half[1];
      const top = k & 2 ? m[row + 2] * half[2] : -m[row + 2] * half[2];
      square += (m[row] * half[0] + side + top) ** 2;
    }
    most = Math.max(most, square);
  }
  out[outAt + 3] = Math.min(Math.sqrt(most) * (1 + 1e-6), 3.4028234663852886e38);
}

/**
 * The view of a scene as a mesh sees it under a transform; undefined where the transform flattens
 * the mesh.
 */
export function viewInMesh(view: View, m: Rows, at: number): View | undefined {
  const [least, most] = stretchOf(m, at);
  if (view.kind === "error") return { kind: "error", error: view.error / most };
  if (view.kind === "level") return view;
  const columns = cofactorsOf(m, at);
  const determinant = dot(rowOf(m, at, 0), columns[0] as readonly number[]);
  if (!(least > 0) || determinant === 0) return undefined;
  const from = [0, 1, 2].map((i) => (view.eye[i] as number) - m[at + 4 * i + 3]);
  const eye = [0, 1, 2].map((i) =>
    Math.fround(columns.reduce((sum, c, k) => sum + c[i] * from[k], 0) / determinant),
  );
  const found: CameraView = {
    ...view,
    eye: [eye[0], eye[1], eye[2]],
    threshold: Math.fround((view.threshold * least) / most),
  };
  if (view.planes) found.planes = planesInMesh(view.planes, m, at);
  return found;
}

/** Whether a transform turns the mesh inside out. */
export function isMirrored(m: Rows, at: number): boolean {
  return dot(rowOf(m, at, 0), cofactorsOf(m, at)[0] as readonly number[]) < 0;
}

/** For each row the product of the two others: the inverse's columns, times the determinant. */
function cofactorsOf(m: Rows, at: number): [number, number, number][] {
  return [0, 1, 2].map((k) => cross(rowOf(m, at, (k + 1) % 3), rowOf(m, at, (k + 2) % 3)));
}

function rowOf(m: Rows, at: number, i: number): [number, number, number] {
  return [m[at + 4 * i], m[at + 4 * i + 1], m[at + 4 * i + 2]];
}

/** Planes of a scene as a mesh sees them under a transform. */
function planesInMesh(planes: ArrayLike<number>, m: Rows, at: number): Float32Array {
  const out = new Float32Array(planes.length);
  for (let p = 0; p < planes.length; p += 4) {
    const normal = [0, 0, 0];
    let offset = planes[p + 3];
    for (let i = 0; i < 3; ++i) {
      for (let k = 0; k < 3; ++k) normal[i] += m[at + 4 * k + i] * planes[p + k];
      offset += planes[p + i] * m[at + 4 * i + 3];
    }
    const length = Math.hypot(...normal);
    for (let i = 0; i < 3; ++i) out[p + i] = normal[i] / length;
    out[p + 3] = offset / length;
  }
  return out;
}

function cross(a: readonly number[], b: readonly number[]): [number, number, number] {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
