// How large each texture should be: as large as it is seen, where the memory allows.

/** A texture's image, as the plan sees it. */
export interface Planned {
  /** Texels of the longer side that a camera could tell apart; 0 where nothing of it is in view. */
  wanted: number;
  /** What is there now; 0 if nothing is. */
  size: number;
  /** The smallest copy that is worth having, and the full image. */
  least: number;
  full: number;
  /** Memory that a size takes. */
  bytesOf(size: number): number;
}

/** The sizes that each image should have, all together of `limit` bytes if that can be. */
export function planSizes(images: readonly Planned[], limit: number): number[] {
  const sizes = images.map((image) => (image.wanted > 0 ? enough(image) : image.size));
  let bytes = images.reduce((sum, image, i) => sum + image.bytesOf(sizes[i] as number), 0);
  while (bytes > limit) {
    const i = mostTooLarge(images, sizes);
    if (i < 0) break;
    const image = images[i] as Planned;
    const smaller = Math.max(Math.ceil((sizes[i] as number) / 2), image.least);
    bytes += image.bytesOf(smaller) - image.bytesOf(sizes[i] as number);
    sizes[i] = smaller;
  }
  return sizes;
}

/** The full size halved as long as it is still enough; not less than what is there. */
function enough({ wanted, size, least, full }: Planned): number {
  let found = full;
  while (found / 2 >= wanted && found / 2 >= least) found = Math.ceil(found / 2);
  return Math.max(found, size);
}

/** The image that has most texels for each that is seen, of those that can be made smaller. */
function mostTooLarge(images: readonly Planned[], sizes: readonly number[]): number {
  let found = -1;
  let most = 0;
  let mostBytes = 0;
  images.forEach((image, i) => {
    const size = sizes[i] as number;
    if (size <= image.least) return;
    const excess = size / Math.max(image.wanted, 1e-6);
    const bytes = image.bytesOf(size);
    if (excess < most || (excess === most && bytes <= mostBytes)) return;
    [found, most, mostBytes] = [i, excess, bytes];
  });
  return found;
}
