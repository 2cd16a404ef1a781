// Images of one texel that slots show until their texture arrives: they change nothing, or give no
// light.

export type Placeholder = "white" | "black" | "normal" | "direction";

const TEXELS: Record<Placeholder, readonly number[]> = {
  white: [255, 255, 255, 255],
  black: [0, 0, 0, 255],
  normal: [128, 128, 255, 255],
  direction: [255, 128, 255, 255],
};

const images = new Map<Placeholder, ImageData>();

export function placeholderImage(kind: Placeholder): ImageData {
  let image = images.get(kind);
  if (!image) {
    image = new ImageData(Uint8ClampedArray.from(TEXELS[kind]), 1, 1);
    images.set(kind, image);
  }
  return image;
}
