// The surroundings: a studio of soft boxes under a sky, so that metals, glass and lacquer have
// something to mirror. What is matt gets as much light from it as from the sky of light.ts alone,
// which is all that the first picture knows of.

import {
  DataTexture,
  DataUtils,
  EquirectangularReflectionMapping,
  HalfFloatType,
  LinearFilter,
  PMREMGenerator,
  RGBAFormat,
  type Texture,
  type WebGLRenderer,
} from "three";
import { linear, SKY } from "./light";

const WIDTH = 256;
const HEIGHT = 128;
/** How sharp the horizon is. */
const HORIZON = 4;

type Point = readonly [number, number, number];

/** A soft box: where it is seen, how far it reaches around there, and how bright it is. */
interface Box {
  at: Point;
  reach: number;
  light: number;
}

const BOXES: readonly Box[] = [
  { at: [-0.62, 0.55, 0.56], reach: 0.3, light: 2.2 },
  { at: [0.86, 0.3, 0.41], reach: 0.22, light: 1.8 },
  { at: [0.1, 0.75, -0.66], reach: 0.3, light: 1.6 },
  { at: [-0.8, 0.12, -0.58], reach: 0.16, light: 1.6 },
];

/** To be disposed of by whoever asked for it. */
export function makeEnvironment(renderer: WebGLRenderer): Texture {
  const generator = new PMREMGenerator(renderer);
  const panorama = makePanorama();
  const { texture } = generator.fromEquirectangular(panorama);
  panorama.dispose();
  generator.dispose();
  return texture;
}

function makePanorama(): DataTexture {
  const pixels = radiances();
  const data = new Uint16Array(4 * WIDTH * HEIGHT);
  for (let i = 0; i < WIDTH * HEIGHT; ++i) {
    for (let c = 0; c < 3; ++c)
      data[4 * i + c] = DataUtils.toHalfFloat(pixels[3 * i + c] as number);
    data[4 * i + 3] = 0x3c00;
  }
  const texture = new DataTexture(data, WIDTH, HEIGHT, RGBAFormat, HalfFloatType);
  texture.mapping = EquirectangularReflectionMapping;
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** Light from all directions, three numbers each; rows from straight down to straight up. */
function radiances(): Float64Array {
  const boxes = each((direction) => brightness(direction));
  const rise = each(([, y]) => Math.tanh(HORIZON * y));
  const [boxMean, boxRise] = moments(boxes);
  const [, riseRise] = moments(rise);
  const sky = linear(SKY.color, SKY.intensity);
  const ground = linear(SKY.ground, SKY.intensity);
  const out = new Float64Array(3 * WIDTH * HEIGHT);
  for (let c = 0; c < 3; ++c) {
    // Such that a matt surface is lit by half of both, and by more sky the more it faces up.
    const mean = ((ground[c] as number) + (sky[c] as number)) / (2 * Math.PI);
    const slope = (3 * ((sky[c] as number) - (ground[c] as number))) / (4 * Math.PI);
    const share = (slope - boxRise) / riseRise;
    for (let i = 0; i < boxes.length; ++i) {
      const light = mean - boxMean + share * (rise[i] as number) + (boxes[i] as number);
      out[3 * i + c] = Math.max(light, 0);
    }
  }
  return out;
}

function brightness([x, y, z]: Point): number {
  return BOXES.reduce((sum, { at, reach, light }) => {
    const away = Math.acos(Math.min(x * at[0] + y * at[1] + z * at[2], 1)) / reach;
    return sum + light / (1 + Math.exp(8 * (away - 1)));
  }, 0);
}

function each(value: (direction: Point) => number): Float64Array {
  return Float64Array.from({ length: WIDTH * HEIGHT }, (_, i) => {
    const up = (Math.floor(i / WIDTH) + 0.5) / HEIGHT;
    const around = 2 * Math.PI * (((i % WIDTH) + 0.5) / WIDTH - 0.5);
    const flat = Math.sin(Math.PI * up);
    // As three.js looks directions up in a panorama.
    return value([flat * Math.cos(around), -Math.cos(Math.PI * up), flat * Math.sin(around)]);
  });
}

/** The mean over all directions, and how much more there is the higher one looks. */
function moments(values: Float64Array): [number, number] {
  let [mean, rise, weights] = [0, 0, 0];
  for (let i = 0; i < values.length; ++i) {
    const up = Math.PI * ((Math.floor(i / WIDTH) + 0.5) / HEIGHT);
    const weight = Math.sin(up);
    mean += weight * (values[i] as number);
    rise -= weight * (values[i] as number) * Math.cos(up);
    weights += weight;
  }
  return [mean / weights, (3 * rise) / weights];
}
