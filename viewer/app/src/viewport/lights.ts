// The lamps: one above the viewer's left shoulder, one from the right; and the sky, which is also
// what metals and glass mirror (see environment.ts).

export interface Lamp {
  color: number;
  intensity: number;
  /** Where it stands, as the viewer sees it: to the right, up, towards them. */
  from: readonly [number, number, number];
}

export const KEY: Lamp = { color: 0xfff4e6, intensity: 1.7, from: [-0.6, 0.9, 0.8] };
export const FILL: Lamp = { color: 0xcfe2ff, intensity: 0.45, from: [0.9, 0.1, 0.15] };
export const SKY = { color: 0xf0f4ff, ground: 0x7d756c, intensity: 1.5 };

/** A colour in linear light, from 0 to 1 before its intensity. */
export function linear(color: number, intensity: number): [number, number, number] {
  return [16, 8, 0].map((shift) => {
    const c = ((color >> shift) & 255) / 255;
    return intensity * (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  }) as [number, number, number];
}
