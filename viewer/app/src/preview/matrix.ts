// The matrices of the preview: four columns of four, as WebGL takes them.

export type Matrix = number[];
type Point = [number, number, number];

const AXES = [0, 1, 2] as const;

function cross([a, b, c]: Point, [x, y, z]: Point): Point {
  return [b * z - c * y, c * x - a * z, a * y - b * x];
}

function dot(a: Point, b: Point): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function normalised(v: Point): Point {
  const length = Math.hypot(...v) || 1;
  return v.map((x) => x / length) as Point;
}

function column(m: Matrix, i: number): Point {
  return m.slice(4 * i, 4 * i + 3) as Point;
}

/** The matrix of three rows of four. */
export function fromRows(rows: ArrayLike<number>): Matrix {
  return [0, 1, 2, 3].flatMap((i) => [
    ...AXES.map((axis) => rows[4 * axis + i] as number),
    +(i > 2),
  ]);
}

export function multiply(a: Matrix, b: Matrix): Matrix {
  return Array.from({ length: 16 }, (_, at) => {
    const row = at % 4;
    const first = at - row;
    return [0, 1, 2, 3].reduce(
      (sum, k) => sum + (a[4 * k + row] as number) * (b[first + k] as number),
      0,
    );
  });
}

/** From the world to a camera that looks at `target`, with y up. */
export function viewMatrix(eye: Point, target: Point): Matrix {
  const back = normalised(eye.map((x, i) => x - (target[i] as number)) as Point);
  // Any direction may be to the right of a camera that looks straight up or down.
  const across = cross([0, 1, 0], back);
  const right = normalised(Math.hypot(...across) > 1e-9 ? across : [1, 0, 0]);
  const axes = [right, cross(back, right), back] as const;
  return [
    ...AXES.flatMap((i) => [...axes.map((axis) => axis[i]), 0]),
    ...axes.map((axis) => -dot(axis, eye)),
    1,
  ];
}

/** The projection of OpenGL; `fov` is vertical, in radians. */
export function perspective(fov: number, aspect: number, near: number, far: number): Matrix {
  const y = 1 / Math.tan(fov / 2);
  const depth = (far + near) / (near - far);
  return [
    y / aspect,
    0,
    0,
    0,
    0,
    y,
    0,
    0,
    0,
    0,
    depth,
    -1,
    0,
    0,
    (2 * far * near) / (near - far),
    0,
  ];
}

/** The four side planes of a view volume: normals that point inside, and distances. */
export function sidePlanesOf(m: Matrix): Float32Array {
  const row = (i: number) => [0, 1, 2, 3].map((j) => m[4 * j + i] as number);
  const last = row(3);
  return Float32Array.from(
    [0, 1].flatMap((axis) =>
      [1, -1].flatMap((sign) => {
        const plane = row(axis).map((x, i) => (last[i] as number) + sign * x);
        const length = Math.hypot(...plane.slice(0, 3));
        return plane.map((x) => x / length);
      }),
    ),
  );
}

/** The point that a matrix maps to the origin. */
export function originOf(m: Matrix): Point {
  const [a, b, c, t] = [column(m, 0), column(m, 1), column(m, 2), column(m, 3)];
  const volume = dot(a, cross(b, c));
  return [cross(b, c), cross(c, a), cross(a, b)].map((row) => -dot(row, t) / volume) as Point;
}

/** The scales of a matrix along its axes. */
export function scalesOf(m: Matrix): number[] {
  return AXES.map((i) => Math.hypot(...column(m, i)));
}
