// An image of an asset: its copies in the file, what of it is on the GPU, and who shows it.

import { type Material, Texture } from "three";
import { type Json, listOf, numberOf, textOf } from "../../format/gltf.js";
import { bytesOf, extentOf, type Picture, sizeOf, texelBytes } from "./image_decoder.js";
import { applySampler, hasMipmaps } from "./sampler.js";
import type { Planned } from "./texture_plan.js";

/** Where the bytes of a copy are, and its longer side in texels; 0 where that is not said. */
export interface ImageLevel {
  file: number | undefined;
  uri: string;
  size: number;
}

/** A texture of three.js that shows an image, and the slots of materials that it is in. */
interface Showing {
  texture: Texture;
  sampler: Json;
  info: Json;
  isColor: boolean;
  key: string;
  uses: { material: Material; slots: readonly string[] }[];
}

/** What an image is thought to be where the asset does not say. */
const GUESS = 1024;
/** Where there are no smaller copies: what images are shrunk to, at most. */
const LEAST = 128;

export class StreamedImage implements Planned {
  wanted = 0;
  size = 0;
  full: number;
  least: number;
  isBusy = false;
  /** Whether it cannot be had, for good. */
  isBroken = false;
  /** How often in a row it could not be had. */
  failures = 0;
  /** The bytes of a copy of which less is shown than there is. */
  kept: { level: ImageLevel; bytes: Uint8Array } | undefined;
  readonly name: string;
  private readonly levels: ImageLevel[];
  private readonly showings: Showing[] = [];
  private picture: Picture | undefined;
  /** Width times height, over the longer side squared. */
  private shape = 1;

  constructor(gltf: Json) {
    this.name = textOf(gltf.name);
    this.levels = levelsOf(gltf);
    const full = this.levels.at(-1)?.size ?? 0;
    const least = this.levels[0]?.size ?? 0;
    this.full = full || Math.max(GUESS, least);
    this.least = Math.min(this.levels.length > 1 ? least : LEAST, this.full);
    this.isBroken = this.levels.length === 0;
  }

  /** Bytes on the GPU. */
  get bytes(): number {
    return this.picture ? this.bytesOf(this.size) : 0;
  }

  bytesOf(size: number): number {
    if (size === 0) return 0;
    const isOnlyOnce = new Map(this.showings.map((each) => [each.key, hasMipmaps(each.sampler)]));
    let bytes = 0;
    for (const mipmaps of isOnlyOnce.values()) {
      if (this.picture instanceof Texture)
        bytes += bytesOf(this.picture, mipmaps) * (size / this.size) ** 2;
      else bytes += texelBytes(size, size * this.shape, mipmaps);
    }
    return bytes;
  }

  /** What to read for a size: the smallest copy first, then one that is large enough. */
  levelFor(size: number): ImageLevel {
    const { levels } = this;
    const enough = levels.find((level) => level.size >= size) ?? levels.at(-1);
    return (this.size === 0 ? levels[0] : enough) as ImageLevel;
  }

  /** A copy was decoded: it may be of another size than the asset says. */
  learn(level: ImageLevel, picture: Picture): void {
    level.size = sizeOf(picture);
    const { width, height } = extentOf(picture);
    this.shape = (width * height) / level.size ** 2;
    if (level === this.levels.at(-1)) this.full = level.size;
    this.least = Math.min(this.least, this.full);
  }

  /** Puts it into slots of a material, now or once it is there; until then they have `neutral`. */
  use(
    material: Material,
    slots: readonly string[],
    look: { sampler: Json; info: Json; isColor: boolean; neutral: ImageData },
  ): void {
    const { sampler, info, isColor } = look;
    const key = JSON.stringify([sampler, isColor]);
    const texture = this.make(this.picture ?? look.neutral, { sampler, info, isColor });
    const showing = { texture, sampler, info, isColor, key, uses: [{ material, slots }] };
    this.showings.push(showing);
    putInto(showing);
  }

  show(picture: Picture): void {
    const before = this.picture;
    this.picture = picture;
    this.size = sizeOf(picture);
    if (this.kept && this.kept.level.size <= this.size) this.kept = undefined;
    let shared: Texture["source"] | undefined;
    for (const showing of this.showings) {
      showing.texture.dispose();
      showing.texture = this.make(picture, showing);
      // One copy on the GPU for all that look it up in the same way.
      shared ??= showing.texture.source;
      showing.texture.source = shared;
      putInto(showing);
    }
    if (before && before !== picture) close(before);
  }

  /** What is shown. */
  get shown(): Picture | undefined {
    return this.picture;
  }

  private make(
    picture: Picture | ImageData,
    { sampler, info, isColor }: Pick<Showing, "sampler" | "info" | "isColor">,
  ): Texture {
    const isBlocks = picture instanceof Texture;
    const texture: Texture = isBlocks ? picture.clone() : new Texture(picture);
    applySampler(texture, sampler, info, isColor);
    if (isBlocks) texture.generateMipmaps = false;
    texture.needsUpdate = true;
    return texture;
  }

  dispose(): void {
    for (const { texture } of this.showings) texture.dispose();
    if (this.picture) close(this.picture);
  }
}

function putInto({ texture, uses }: Showing): void {
  for (const { material, slots } of uses)
    for (const slot of slots) (material as unknown as Record<string, Texture>)[slot] = texture;
}

export function close(picture: Picture): void {
  if (picture instanceof Texture) picture.dispose();
  else picture.close();
}

/** The copies of an image, smallest first; the image itself is the last. */
function levelsOf(image: Json): ImageLevel[] {
  const smaller = listOf(image.levels)
    .map(levelOf)
    .filter(({ size }) => size > 0)
    .sort((a, b) => a.size - b.size);
  return [...smaller, levelOf(image)].filter(({ file, uri }) => file !== undefined || uri !== "");
}

function levelOf({ file, uri, width, height }: Json): ImageLevel {
  return {
    file: Number.isSafeInteger(file) ? (file as number) : undefined,
    uri: textOf(uri),
    size: Math.min(Math.max(numberOf(width, 0), numberOf(height, 0), 0), 2 ** 16),
  };
}
