// An image of an asset: its copies in the file, the one on the GPU, and the textures that show it.

import { type Material, Texture } from "three";
import { type Json, listOf, numberOf, textOf } from "../../format/gltf.js";
import { bytesOf, type DecodedImage, extentOf, sizeOf, texelBytes } from "./image_decoder.js";
import { applySampler, hasMipmaps } from "./sampler.js";
import type { PlannedImage } from "./texture_plan.js";

/** A copy of an image: where its bytes are, and its longer side in texels; 0 if that is unknown. */
export interface ImageLevel {
  file: number | undefined;
  uri: string;
  size: number;
}

/** A texture of three.js that shows the image, and the slots that it is in. */
interface ImageTexture {
  texture: Texture;
  sampler: Json;
  info: Json;
  isColor: boolean;
  /** Textures of one key share their memory on the GPU. */
  key: string;
  uses: { material: Material; slots: readonly string[] }[];
}

/** Estimated size of an image where the asset states none. */
const DEFAULT_SIZE = 1024;
/** Size down to which an image without smaller copies is shrunk. */
const MIN_SIZE = 128;

export class StreamedImage implements PlannedImage {
  wanted = 0;
  size = 0;
  full: number;
  smallest: number;
  isBusy = false;
  /** Whether it cannot be read: never, or until the next attempt. */
  isBroken = false;
  /** Number of failed attempts in a row. */
  failures = 0;
  /** The file of a copy that is shown shrunk, kept so that the image can grow again. */
  kept: { level: ImageLevel; bytes: Uint8Array } | undefined;
  readonly name: string;
  private readonly levels: ImageLevel[];
  private readonly textures: ImageTexture[] = [];
  private decoded: DecodedImage | undefined;
  /** That of the decoded copy: textures with the same sampler share their memory on the GPU by it. */
  private source: Texture["source"] | undefined;
  /** Width times height, over the longer side squared. */
  private shape = 1;

  constructor(gltf: Json) {
    this.name = textOf(gltf.name);
    this.levels = levelsOf(gltf);
    const full = this.levels.at(-1)?.size ?? 0;
    const smallest = this.levels[0]?.size ?? 0;
    this.full = full || Math.max(DEFAULT_SIZE, smallest);
    this.smallest = Math.min(this.levels.length > 1 ? smallest : MIN_SIZE, this.full);
    this.isBroken = this.levels.length === 0;
  }

  /** Bytes on the GPU. */
  get bytes(): number {
    return this.decoded ? this.bytesOf(this.size) : 0;
  }

  bytesOf(size: number): number {
    if (size === 0) return 0;
    const mipmapsOfKey = new Map(this.textures.map((each) => [each.key, hasMipmaps(each.sampler)]));
    let bytes = 0;
    for (const mipmaps of mipmapsOfKey.values()) {
      if (this.decoded instanceof Texture)
        bytes += bytesOf(this.decoded, mipmaps) * (size / this.size) ** 2;
      else bytes += texelBytes(size, size * this.shape, mipmaps);
    }
    return bytes;
  }

  /** The copy to read for a size: the smallest copy first, then one that is large enough. */
  levelFor(size: number): ImageLevel {
    const { levels } = this;
    const sufficient = levels.find((level) => level.size >= size) ?? levels.at(-1);
    return (this.size === 0 ? levels[0] : sufficient) as ImageLevel;
  }

  /** Takes the size of a decoded copy, which may differ from the size that the asset states. */
  setDecodedSize(level: ImageLevel, image: DecodedImage): void {
    level.size = sizeOf(image);
    const { width, height } = extentOf(image);
    this.shape = (width * height) / level.size ** 2;
    if (level === this.levels.at(-1)) this.full = level.size;
    this.smallest = Math.min(this.smallest, this.full);
  }

  /** Puts the image into slots of a material; they show `placeholder` until the image arrives. */
  use(
    material: Material,
    slots: readonly string[],
    sampling: { sampler: Json; info: Json; isColor: boolean; placeholder: ImageData },
  ): void {
    const { sampler, info, isColor } = sampling;
    const key = JSON.stringify([sampler, isColor]);
    const texture = this.make(this.decoded ?? sampling.placeholder, { sampler, info, isColor });
    const showing = { texture, sampler, info, isColor, key, uses: [{ material, slots }] };
    this.textures.push(showing);
    assignToSlots(showing);
  }

  show(image: DecodedImage): void {
    const before = this.decoded;
    this.decoded = image;
    this.source = undefined;
    this.size = sizeOf(image);
    if (this.kept && this.kept.level.size <= this.size) this.kept = undefined;
    for (const showing of this.textures) {
      showing.texture.dispose();
      showing.texture = this.make(image, showing);
      assignToSlots(showing);
    }
    if (before && before !== image) close(before);
  }

  /** The current copy. */
  get shown(): DecodedImage | undefined {
    return this.decoded;
  }

  private make(
    image: DecodedImage | ImageData,
    { sampler, info, isColor }: Pick<ImageTexture, "sampler" | "info" | "isColor">,
  ): Texture {
    const isCompressed = image instanceof Texture;
    const texture: Texture = isCompressed ? image.clone() : new Texture(image);
    applySampler(texture, sampler, info, isColor);
    if (isCompressed) texture.generateMipmaps = false;
    texture.needsUpdate = true;
    if (image === this.decoded) {
      this.source ??= texture.source;
      texture.source = this.source;
    }
    return texture;
  }

  dispose(): void {
    for (const { texture } of this.textures) texture.dispose();
    if (this.decoded) close(this.decoded);
  }
}

function assignToSlots({ texture, uses }: ImageTexture): void {
  for (const { material, slots } of uses)
    for (const slot of slots) (material as unknown as Record<string, Texture>)[slot] = texture;
}

export function close(image: DecodedImage): void {
  if (image instanceof Texture) image.dispose();
  else image.close();
}

/** The copies of an image, smallest first; the last is the image itself. */
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
