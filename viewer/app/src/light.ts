// The lamps: one above the viewer's left shoulder, one from the right, and the sky.

export interface Lamp {
  color: number;
  intensity: number;
  /** Where it stands, as the viewer sees it: to the right, up, towards them. */
  from: readonly [number, number, number];
}

export const KEY: Lamp = { color: 0xfff4e6, intensity: 2.1, from: [-0.6, 0.9, 0.8] };
export const FILL: Lamp = { color: 0xcfe2ff, intensity: 0.55, from: [0.9, 0.1, 0.15] };
export const SKY = { color: 0xf0f4ff, ground: 0x5a5148, intensity: 1.15 };
/** Metals mirror what is around them, and here is nothing: with lamps alone they would be black. */
export const MOST_METAL = 0.4;
