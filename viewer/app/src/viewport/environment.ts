// The environment map: a studio of soft boxes under a sky, for metals, glass and clear coats to
// reflect. On diffuse surfaces it has the effect of the sky of lights.ts, which lights the preview.
//
// three.js would blur a panorama on the GPU for each roughness. This map is a formula, so it is
// computed blurred, on few texels, at once.

import {
  CompressedCubeTexture,
  type CompressedPixelFormat,
  DataUtils,
  HalfFloatType,
  LinearFilter,
  LinearMipmapLinearFilter,
  RGBAFormat,
  type Texture,
} from "three";
import { linear, SKY_LIGHT } from "./lights";

/** Texels of a face's side for each mip level, from mirrors to diffuse surfaces. */
const SIDES = [64, 32, 16, 8];
/** Sharpness of the horizon, and of the edges of soft boxes. */
const HORIZON = 4;
const EDGE = 8;

type Point = readonly [number, number, number];

/** A soft box: its direction, its radius as an angle, and its brightness. */
interface Box {
  at: Point;
  radius: number;
  light: number;
}

const BOXES: readonly Box[] = [
  { at: [-0.62, 0.55, 0.56], radius: 0.3, light: 2.2 },
  { at: [0.86, 0.3, 0.41], radius: 0.22, light: 1.8 },
  { at: [0.1, 0.75, -0.66], radius: 0.3, light: 1.6 },
  { at: [-0.8, 0.12, -0.58], radius: 0.16, light: 1.6 },
];

/** The direction of a point on each cube face, `s` to the right and `t` down, as in WebGL. */
const FACES: readonly ((s: number, t: number) => Point)[] = [
  (s, t) => [1, -t, -s],
  (s, t) => [-1, -t, s],
  (s, t) => [s, 1, t],
  (s, t) => [s, -1, -t],
  (s, t) => [s, -t, 1],
  (s, t) => [-s, -t, -1],
];

/** Makes the environment map of a scene; the caller disposes of it. */
export function makeEnvironment(): Texture {
  const studio = new Studio();
  const images = FACES.map((face) => {
    const mipmaps = SIDES.map((side, level) => ({
      data: faceTexels(side, (s, t) => studio.light(normalised(face(s, t)), level)),
      width: side,
      height: side,
    }));
    return { ...mipmaps[0], width: SIDES[0], height: SIDES[0], mipmaps, format: RGBAFormat };
  });
  const texture = new CompressedCubeTexture(
    images as unknown as ConstructorParameters<typeof CompressedCubeTexture>[0],
    RGBAFormat as unknown as CompressedPixelFormat,
    HalfFloatType,
  );
  texture.minFilter = LinearMipmapLinearFilter;
  texture.magFilter = LinearFilter;
  texture.isPMREMTexture = true;
  texture.needsUpdate = true;
  return texture;
}

function faceTexels(side: number, light: (s: number, t: number) => Point): Uint16Array {
  const data = new Uint16Array(4 * side * side);
  for (let i = 0; i < side * side; ++i) {
    const s = (2 * ((i % side) + 0.5)) / side - 1;
    const t = (2 * (Math.floor(i / side) + 0.5)) / side - 1;
    const texel = [...light(s, t), 1].map((c) => DataUtils.toHalfFloat(c));
    data.set(texel, 4 * i);
  }
  return data;
}

function normalised([x, y, z]: Point): Point {
  const length = Math.hypot(x, y, z);
  // Cube maps are mirrored.
  return [-x / length, y / length, z / length];
}

class Studio {
  private readonly mean: Point;
  private readonly slope: Point;
  private readonly boxMean: number;
  private readonly boxSlope: number;
  private readonly horizonSlope: number;

  constructor() {
    const sky = linear(SKY_LIGHT.color, SKY_LIGHT.intensity);
    const ground = linear(SKY_LIGHT.ground, SKY_LIGHT.intensity);
    // A horizontal normal receives half of each; a normal that points up receives the sky alone.
    this.mean = each((c) => ((ground[c] as number) + (sky[c] as number)) / (2 * Math.PI));
    this.slope = each((c) => (3 * ((sky[c] as number) - (ground[c] as number))) / (4 * Math.PI));
    [this.boxMean, this.boxSlope] = moments((direction) => boxLight(direction, 0));
    this.horizonSlope = moments(([, y]) => Math.tanh(HORIZON * y))[1];
  }

  /** The radiance from a direction, blurred for the roughness of a mip level. */
  light(direction: Point, level: number): Point {
    const [, y] = direction;
    const last = SIDES.length - 1;
    if (level === last) return each((c) => this.mean[c] + (2 / 3) * this.slope[c] * y);
    const roughness = 1 - Math.sqrt(1 - level / last);
    const blur = 1.2 * roughness ** 2;
    const boxes = boxLight(direction, blur);
    const rise = Math.tanh(y / Math.hypot(1 / HORIZON, blur)) / this.horizonSlope;
    return each((c) =>
      Math.max(this.mean[c] - this.boxMean + (this.slope[c] - this.boxSlope) * rise + boxes, 0),
    );
  }
}

function each(value: (channel: 0 | 1 | 2) => number): Point {
  return [value(0), value(1), value(2)];
}

function boxLight([x, y, z]: Point, blur: number): number {
  return BOXES.reduce((sum, { at, radius, light }) => {
    const blurred = Math.hypot(radius, blur);
    const cosine = x * at[0] + y * at[1] + z * at[2];
    const away = Math.acos(Math.min(Math.max(cosine, -1), 1)) / blurred;
    const edge = (EDGE * radius) / blurred;
    return sum + (light * (radius / blurred) ** 2) / (1 + Math.exp(edge * (away - 1)));
  }, 0);
}

/** The mean of a function over all directions, and its slope along y. */
function moments(value: (direction: Point) => number): [number, number] {
  const count = 4000;
  let [mean, rise] = [0, 0];
  for (let i = 0; i < count; ++i) {
    const y = (2 * i + 1) / count - 1;
    const around = i * Math.PI * (3 - Math.sqrt(5));
    const flat = Math.sqrt(1 - y * y);
    const sample = value([flat * Math.cos(around), y, flat * Math.sin(around)]);
    mean += sample / count;
    rise += (3 * sample * y) / count;
  }
  return [mean, rise];
}
