// The lights: a key light from the upper left, a fill light from the right, and the sky. The
// environment map shows the sky too; see environment.ts.

export interface LightSetup {
  color: number;
  intensity: number;
  /** Direction to the light in the camera's axes: right, up, backwards. */
  from: readonly [number, number, number];
}

export const KEY_LIGHT: LightSetup = { color: 0xfff4e6, intensity: 1.7, from: [-0.6, 0.9, 0.8] };
export const FILL_LIGHT: LightSetup = { color: 0xcfe2ff, intensity: 0.45, from: [0.9, 0.1, 0.15] };
export const SKY_LIGHT = { color: 0xf0f4ff, ground: 0x7d756c, intensity: 1.5 };

/** A colour (0xrrggbb) in linear light, times an intensity. */
export function linear(color: number, intensity: number): [number, number, number] {
  return [16, 8, 0].map((shift) => {
    const c = ((color >> shift) & 255) / 255;
    return intensity * (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  }) as [number, number, number];
}
