// Predicts octahedral normals by the triangles around each vertex: the sum of their area vectors, in
// whole numbers modulo 2^32. docs/format.md specifies it under "Normals by triangles".

/** Of each vertex of the last cluster, octahedral integers; those of the lower half (z < 0) are what
 * the upper half has for -z. */
export const us = new Int32Array(256);
export const vs = new Int32Array(256);
export const isLower = new Uint8Array(256);
const sums = new Int32Array(3 * 256);

/**
 * Predicts the normals of a cluster.
 * @param indices the triangles from `at` to `end`, which name vertices of the group
 * @param first the cluster's first vertex, and `count` how many it has
 */
export function predictNormals(
  rows: Int32Array,
  stride: number,
  indices: Uint32Array,
  at: number,
  end: number,
  first: number,
  count: number,
  shift: number,
  steps: number,
): void {
  sums.fill(0, 0, 3 * count);
  for (let t = at; t < end; t += 3) {
    const a = Math.imul(indices[t], stride);
    const b = Math.imul(indices[t + 1], stride);
    const c = Math.imul(indices[t + 2], stride);
    const ex = ((rows[b] - rows[a]) | 0) >> shift;
    const ey = ((rows[b + 1] - rows[a + 1]) | 0) >> shift;
    const ez = ((rows[b + 2] - rows[a + 2]) | 0) >> shift;
    const fx = ((rows[c] - rows[a]) | 0) >> shift;
    const fy = ((rows[c + 1] - rows[a + 1]) | 0) >> shift;
    const fz = ((rows[c + 2] - rows[a + 2]) | 0) >> shift;
    const x = (Math.imul(ey, fz) - Math.imul(ez, fy)) | 0;
    const y = (Math.imul(ez, fx) - Math.imul(ex, fz)) | 0;
    const z = (Math.imul(ex, fy) - Math.imul(ey, fx)) | 0;
    const p = 3 * (indices[t] - first);
    const q = 3 * (indices[t + 1] - first);
    const r = 3 * (indices[t + 2] - first);
    sums[p] += x;
    sums[p + 1] += y;
    sums[p + 2] += z;
    sums[q] += x;
    sums[q + 1] += y;
    sums[q + 2] += z;
    sums[r] += x;
    sums[r + 1] += y;
    sums[r + 2] += z;
  }
  for (let i = 0; i < count; ++i) {
    const x = sums[3 * i];
    const y = sums[3 * i + 1];
    const z = sums[3 * i + 2];
    const length = Math.abs(x) + Math.abs(y) + Math.abs(z);
    const scale = length > 0 ? steps / length : 0;
    // Rounded down: the numbers are positive.
    us[i] = ((x * scale + (steps + 1.5)) | 0) - (steps + 1);
    vs[i] = ((y * scale + (steps + 1.5)) | 0) - (steps + 1);
    isLower[i] = z < 0 ? 1 : 0;
  }
}

/** One of the two integers that fold the others' half over: `near` is the one in its place. */
export function folded(near: number, far: number, steps: number): number {
  const value = (steps - Math.abs(far)) | 0;
  return near < 0 ? -value | 0 : value;
}
