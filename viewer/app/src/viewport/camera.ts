// The camera's first pose and its depth range.

import { type AssetInfo, type Bounds, boundsOf } from "umbel";
import type { CameraPose } from "../state";

/** Vertical field of view, in degrees. */
export const FIELD_OF_VIEW = 40;
/** Unit vector from the centre of an asset to the camera. */
const HOME_DIRECTION = [0.4034, 0.1972, 0.8935] as const;
/**
 * Factor on the allowed error until all visible materials have a texture of some size. Until then
 * small textures improve the picture more than the same bytes of geometry.
 */
export const UNTEXTURED_ERROR_FACTOR = 8;
/** Space around the asset. */
const MARGIN = 1.06;

type Point = [number, number, number];
type Boxes = Parameters<typeof boundsOf>[0];

export interface Sphere {
  center: Point;
  radius: number;
}

function centerOf({ low, high }: Bounds): Point {
  return low.map((x, i) => 0.5 * (x + (high[i] as number))) as Point;
}

/** The sphere around the bounding box of an asset. */
export function boundingSphereOf(info: Boxes): Sphere {
  const { low, high } = boundsOf(info);
  return {
    center: centerOf({ low, high }),
    radius: 0.5 * Math.hypot(...low.map((x, i) => (high[i] as number) - x)),
  };
}

/**
 * Lengths in the scene for each of an asset: a power of two, so that positions round the same. Shaders
 * square lengths, and the controls ignore small ones, so the scene is neither very small nor very large.
 * Normals, which shaders scale too, limit the factor.
 */
export function sceneUnit(info: AssetInfo): number {
  const { radius } = boundingSphereOf(info);
  if (!(radius > 0)) return 1;
  const hasNormals = info.meshes.some(({ attributes }) => attributes.includes("normals"));
  const exponent = Math.floor(Math.log2(radius));
  return 2 ** Math.min(Math.min(Math.max(exponent, 0), 12) - exponent, hasNormals ? 58 : 120);
}

/** The nearest pose that shows a whole box; `aspect` is the picture's width over height. */
export function homePose({ low, high }: Bounds, aspect: number): CameraPose {
  const center = centerOf({ low, high });
  const up = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
  const [x, y, z] = HOME_DIRECTION;
  const flat = Math.hypot(x, z);
  let distance = 0;
  for (let corner = 0; corner < 8; ++corner) {
    const [a, b, c] = [0, 1, 2].map(
      (i) => ((corner >> i) & 1 ? high : low)[i] - center[i],
    ) as Point;
    const towards = a * x + b * y + c * z;
    const right = Math.abs(a * z - c * x) / flat;
    const above = Math.abs(b * flat - ((a * x + c * z) * y) / flat);
    distance = Math.max(distance, towards + MARGIN * Math.max(right / (up * aspect), above / up));
  }
  const position = center.map((m, i) => m + (distance || 1) * HOME_DIRECTION[i]) as Point;
  return { position, target: center };
}

/** A pose translated by an asset's origin: from the asset to its world if `sign` is 1, back if -1. */
export function translated(
  { position, target }: CameraPose,
  origin: readonly number[],
  sign: 1 | -1,
): CameraPose {
  const move = (point: Point) => point.map((x, i) => x + sign * (origin[i] as number)) as Point;
  return { position: move(position), target: move(target) };
}

/** A pose with all lengths multiplied by `factor`. */
export function scaled({ position, target }: CameraPose, factor: number): CameraPose {
  const scale = (point: Point) => point.map((x) => factor * x) as Point;
  return { position: scale(position), target: scale(target) };
}

/** The depth range of a sphere whose centre is `distance` away. */
export function depthsOf(distance: number, radius: number): { near: number; far: number } {
  const size = Math.max(radius, 1e-20);
  const far = distance + 1.1 * size;
  return { near: Math.max(distance - 1.1 * size, far * 2e-4), far };
}
