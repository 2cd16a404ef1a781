// Predicts texture coordinates by positions: the map from a triangle to its texture coordinates goes
// on beyond its edges. All arithmetic is in 32-bit floats, so that every decoder predicts the same.
// docs/format.md specifies it under "Texture coordinates by positions".

const { fround } = Math;
/** Beyond so many times the edge or the triangle behind it, the map is not trusted. */
const MOST_STEPS = 4;
/** Of what is added to a texture coordinate. */
const MOST = 2 ** 30;

/** What predicts each vertex of a cluster: `predictors` are a, b and across, `closes` says whether a
 * vertex is the last of a region's first triangle. */
interface Predicted {
  rows: Int32Array;
  stride: number;
  first: number;
  count: number;
  predictors: Uint8Array;
  closes: Uint8Array;
  equal: Int32Array;
}

/** Rounded after each operation. */
function dot(ax: number, ay: number, az: number, bx: number, by: number, bz: number): number {
  return fround(fround(fround(ax * bx) + fround(ay * by)) + fround(az * bz));
}

function limitedAndRounded(sum: number): number {
  const limited = Math.max(Math.min(sum, MOST), -MOST);
  return Math.trunc(fround(limited + (limited < 0 ? -0.5 : 0.5)));
}

/** The last prediction. */
export const prediction = { u: 0, v: 0 };
const alongs = new Float32Array(256);
const asides = new Float32Array(256);
/** Vertices that predict each: first, second, third. */
const from = new Uint8Array(3 * 256);
let mapped: Predicted | undefined;

/** Finds where each vertex of a cluster, but for shared ones, is beside those that predict it. */
export function mapUvs(cluster: Predicted): void {
  if (cluster === mapped) return; // for another set
  mapped = cluster;
  const { first, count, predictors, closes, equal } = cluster;
  for (let vertex = 0; vertex < count; ++vertex) {
    if (equal[first + vertex] >= 0) continue;
    const isLast = closes[vertex] === 1;
    const at = 3 * vertex;
    from[at] = isLast ? vertex - 2 : predictors[at];
    from[at + 1] = isLast ? vertex - 1 : predictors[at + 1];
    from[at + 2] = isLast ? vertex - 2 : predictors[at + 2];
    mapVertex(cluster, vertex, isLast);
  }
}

/** Predicts the texture coordinates of a vertex, which are in the columns `at` and `at` + 1. */
export function predictUv(
  cluster: Predicted,
  vertex: number,
  at: number,
  isMirrored: boolean,
): void {
  const { rows, stride, first } = cluster;
  const origin = (first + from[3 * vertex]) * stride + at;
  const second = (first + from[3 * vertex + 1]) * stride + at;
  const u = rows[origin];
  const v = rows[origin + 1];
  const su = fround((rows[second] - u) | 0);
  const sv = fround((rows[second + 1] - v) | 0);
  let tu = isMirrored ? sv : -sv;
  let tv = isMirrored ? -su : su;
  if (cluster.closes[vertex] !== 1) {
    const third = (first + from[3 * vertex + 2]) * stride + at;
    tu = fround((rows[third] - u) | 0);
    tv = fround((rows[third + 1] - v) | 0);
  }
  const along = alongs[vertex];
  const aside = asides[vertex];
  const du = limitedAndRounded(fround(fround(su * along) + fround(tu * aside)));
  const dv = limitedAndRounded(fround(fround(sv * along) + fround(tv * aside)));
  prediction.u = (u + du) | 0;
  prediction.v = (v + dv) | 0;
}

function mapVertex(cluster: Predicted, vertex: number, isLast: boolean): void {
  const { rows, stride, first } = cluster;
  const f = (first + from[3 * vertex]) * stride;
  const s = (first + from[3 * vertex + 1]) * stride;
  const t = (first + from[3 * vertex + 2]) * stride;
  const v = (first + vertex) * stride;
  const fx = rows[f];
  const fy = rows[f + 1];
  const fz = rows[f + 2];
  const x = fround((rows[v] - fx) | 0);
  const y = fround((rows[v + 1] - fy) | 0);
  const z = fround((rows[v + 2] - fz) | 0);
  const ex = fround((rows[s] - fx) | 0);
  const ey = fround((rows[s + 1] - fy) | 0);
  const ez = fround((rows[s + 2] - fz) | 0);
  const wx = fround((rows[t] - fx) | 0);
  const wy = fround((rows[t + 1] - fy) | 0);
  const wz = fround((rows[t + 2] - fz) | 0);
  const ee = dot(ex, ey, ez, ex, ey, ez);
  const xe = dot(x, y, z, ex, ey, ez);
  const we = dot(wx, wy, wz, ex, ey, ez);
  const p = fround(xe / ee);
  const q = fround(we / ee);
  const h = Math.max(fround(dot(x, y, z, x, y, z) - fround(p * xe)), 0);
  const k = isLast ? ee : fround(dot(wx, wy, wz, wx, wy, wz) - fround(q * we));
  const ratio = fround(Math.sqrt(fround(h / k)));
  const along = fround(p + fround(ratio * q));
  const isSound = ee > 0 && k > 0 && Math.abs(along) <= MOST_STEPS && ratio <= MOST_STEPS;
  alongs[vertex] = isSound ? along : 1;
  asides[vertex] = isSound ? -ratio : isLast ? 0 : -1;
}
