// Where the camera stands at first, and how far it sees.

import { boundsOf } from "umbel";
import type { CameraPose } from "../state";

/** In degrees, from the lower edge of the picture to the upper. */
export const FIELD_OF_VIEW = 40;
/** From the middle of an asset to the camera, of length 1. */
const AWAY = [0.4034, 0.1972, 0.8935] as const;
/**
 * How many times the error is allowed until all materials in view have their textures, if small
 * ones: until then a few bytes of them do more for the picture than many of geometry.
 */
export const UNDRESSED = 8;
/** Room around it. */
const MARGIN = 1.06;

type Point = [number, number, number];
type Shown = Parameters<typeof boundsOf>[0];

export interface Ball {
  center: Point;
  radius: number;
}

/** The sphere around all that an asset shows. */
export function ballOf(info: Shown): Ball {
  const { low, high } = boundsOf(info);
  const center = low.map((x, i) => 0.5 * (x + (high[i] as number))) as Point;
  return { center, radius: 0.5 * Math.hypot(...low.map((x, i) => (high[i] as number) - x)) };
}

/** From where all of it is seen, as near as may be; `aspect` is the picture's width over height. */
export function homePose(info: Shown, aspect: number): CameraPose {
  const { low, high } = boundsOf(info);
  const { center } = ballOf(info);
  const up = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
  const [x, y, z] = AWAY;
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
  const position = center.map((m, i) => m + (distance || 1) * AWAY[i]) as Point;
  return { position, target: center };
}

/** A pose moved by an asset's origin: with `sign` 1 into its world, with -1 back to its own zero. */
export function movedBy(
  { position, target }: CameraPose,
  origin: readonly number[],
  sign: 1 | -1,
): CameraPose {
  const move = (point: Point) => point.map((x, i) => x + sign * (origin[i] as number)) as Point;
  return { position: move(position), target: move(target) };
}

/** The distances between which a sphere is seen whose centre is `distance` away. */
export function depthsOf(distance: number, radius: number): { near: number; far: number } {
  const size = Math.max(radius, 1e-20);
  const far = distance + 1.1 * size;
  return { near: Math.max(distance - 1.1 * size, far * 2e-4), far };
}
