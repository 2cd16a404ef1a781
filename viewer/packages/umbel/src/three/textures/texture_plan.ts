// Plans the size of each image: as large as it is visible, where the memory allows.

/** The properties of an image that the plan reads. */
export interface PlannedImage {
  /** Texels of the longer side at one texel a pixel; 0 if the image is not in view. */
  wanted: number;
  /** Current size of the longer side; 0 if there is none. */
  size: number;
  /** Size of the smallest useful copy, and of the full image. */
  smallest: number;
  full: number;
  /** Bytes of memory at a size. */
  bytesOf(size: number): number;
}

/** Plans the size of each image, within `limit` bytes for all if their smallest copies allow it. */
export function planSizes(images: readonly PlannedImage[], limit: number): number[] {
  const sizes = images.map((image) => (image.wanted > 0 ? sufficientSize(image) : image.size));
  let bytes = images.reduce((sum, image, i) => sum + image.bytesOf(sizes[i] as number), 0);
  while (bytes > limit) {
    const i = mostOversized(images, sizes);
    if (i < 0) break;
    const image = images[i] as PlannedImage;
    const smaller = Math.max(Math.ceil((sizes[i] as number) / 2), image.smallest);
    bytes += image.bytesOf(smaller) - image.bytesOf(sizes[i] as number);
    sizes[i] = smaller;
  }
  return sizes;
}

/** The full size, halved while that suffices; not less than the current one. */
function sufficientSize({ wanted, size, smallest, full }: PlannedImage): number {
  let found = full;
  while (found / 2 >= wanted && found / 2 >= smallest) found = Math.ceil(found / 2);
  return Math.max(found, size);
}

/** The image with the most texels for each visible one, of those that can still shrink. */
function mostOversized(images: readonly PlannedImage[], sizes: readonly number[]): number {
  let found = -1;
  let maxExcess = 0;
  let maxBytes = 0;
  images.forEach((image, i) => {
    const size = sizes[i] as number;
    if (size <= image.smallest) return;
    const excess = size / Math.max(image.wanted, 1e-6);
    const bytes = image.bytesOf(size);
    if (excess < maxExcess || (excess === maxExcess && bytes <= maxBytes)) return;
    [found, maxExcess, maxBytes] = [i, excess, bytes];
  });
  return found;
}
