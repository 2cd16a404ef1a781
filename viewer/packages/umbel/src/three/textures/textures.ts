// The textures of an asset: which of their images are worth having, and how large. The smallest
// copies of all that is seen come first, then larger ones, as large as they are seen and as the
// memory allows.

import type { Material, WebGLRenderer } from "three";
import { type Json, jsonOf, listOf, numberOf } from "../../format/gltf.js";
import type { AssetStream } from "../../worker/asset_stream.js";
import { ImageDecoder, shrunk } from "./image_decoder.js";
import { repeatsOf } from "./sampler.js";
import { close, type ImageLevel, StreamedImage } from "./streamed_image.js";
import { planSizes } from "./texture_plan.js";

/** Images that are read or decoded at the same time. */
const PARALLEL = 3;
/** How often one is tried that could not be read, and the milliseconds between. */
const TRIES = 2;
const RETRY_AFTER = 1500;

/** What a slot has until its texture is there: texels that change nothing, or give no light. */
export type Neutral = "white" | "black" | "normal" | "direction";
const NEUTRAL: Record<Neutral, readonly number[]> = {
  white: [255, 255, 255, 255],
  black: [0, 0, 0, 255],
  normal: [128, 128, 255, 255],
  direction: [255, 128, 255, 255],
};

export interface TextureStatistics {
  /** Memory of those that are here. */
  bytes: number;
  /** How many there are, how many of them are here, and how many are to come or to grow. */
  images: number;
  resident: number;
  missing: number;
  /** Whether all that is in view has a copy, if a small one. */
  isComplete: boolean;
  /** Bytes of images that are not in the asset's file. */
  fetchedBytes: number;
}

export class Textures {
  /** Bytes that they may take. */
  limit = Infinity;
  private readonly textures: Json[];
  private readonly samplers: Json[];
  private readonly imageRows: Json[];
  private readonly images = new Map<number, StreamedImage>();
  /** For each material the images in it, and how often each is repeated. */
  private readonly usedBy = new Map<number, { image: StreamedImage; repeats: number }[]>();
  private readonly neutrals = new Map<Neutral, ImageData>();
  private readonly decoder: ImageDecoder;
  private renderer: WebGLRenderer | undefined;
  private active = 0;
  private missing = 0;
  /** Whether a frame began with a copy of all that is in view; larger ones wait for that. */
  private isDressed = false;
  private fetched = 0;
  private isDisposed = false;

  /**
   * @param onChange is told when a texture has arrived or changed its size
   * @param note is told, in a sentence, what cannot be shown
   */
  constructor(
    private readonly stream: AssetStream,
    basisPath: string,
    private readonly onChange: () => void,
    private readonly note: (text: string) => void,
  ) {
    const { textures, samplers, images } = stream.info.materials;
    this.textures = listOf(textures);
    this.samplers = listOf(samplers);
    this.imageRows = listOf(images);
    this.decoder = new ImageDecoder(basisPath);
  }

  /** Whether the asset has images at all. */
  get hasAny(): boolean {
    return this.imageRows.length > 0;
  }

  get statistics(): TextureStatistics {
    const images = [...this.images.values()];
    return {
      bytes: images.reduce((sum, { bytes }) => sum + bytes, 0),
      images: images.length,
      resident: images.filter(({ size }) => size > 0).length,
      missing: this.missing,
      isComplete: this.isComplete,
      fetchedBytes: this.fetched,
    };
  }

  /** Puts a texture of glTF into slots of a material; false if there is none. */
  use(
    number: number,
    material: Material,
    slots: readonly string[],
    info: Json,
    isColor: boolean,
    neutral: Neutral,
  ): boolean {
    const texture = this.textures[numberOf(info.index, -1)];
    const image = texture && this.image(sourceOf(texture));
    if (!image) return false;
    const sampler = this.samplers[numberOf(texture.sampler, -1)] ?? {};
    image.use(material, slots, { sampler, info, isColor, neutral: this.neutral(neutral) });
    const used = this.usedBy.get(number) ?? [];
    used.push({ image, repeats: repeatsOf(info) });
    this.usedBy.set(number, used);
    return true;
  }

  private image(index: number): StreamedImage | undefined {
    const row = this.imageRows[index];
    if (!row) return undefined;
    let image = this.images.get(index);
    if (!image) {
      image = new StreamedImage(row);
      this.images.set(index, image);
      if (image.isBroken) this.note("The asset does not say where some of its textures are.");
    }
    return image;
  }

  private neutral(kind: Neutral): ImageData {
    let image = this.neutrals.get(kind);
    if (!image) {
      image = new ImageData(Uint8ClampedArray.from(NEUTRAL[kind]), 1, 1);
      this.neutrals.set(kind, image);
    }
    return image;
  }

  /**
   * Takes what is seen, and asks for what is worth having.
   * @param seen for each material in view the texels of a whole texture that could be told apart
   */
  see(seen: ReadonlyMap<number, number>, renderer: WebGLRenderer): void {
    this.renderer = renderer;
    for (const image of this.images.values()) image.wanted = 0;
    for (const [material, texels] of seen)
      for (const { image, repeats } of this.usedBy.get(material) ?? [])
        image.wanted = Math.max(image.wanted, texels / repeats, 1);
    this.plan();
  }

  /** To be called before each frame that draws something. */
  beginFrame(): void {
    if (this.isDressed || !this.isComplete) return;
    this.isDressed = true;
    this.plan();
  }

  /** Whether all that is in view has a copy, if a small one, or cannot have any. */
  private get isComplete(): boolean {
    for (const { wanted, size, isBroken } of this.images.values())
      if (wanted > 0 && size === 0 && !isBroken) return false;
    return true;
  }

  private plan(): void {
    if (!this.renderer || this.isDisposed) return;
    const growing: { image: StreamedImage; size: number }[] = [];
    this.sizes().forEach((size, image) => {
      if (size > image.size) growing.push({ image, size });
      else if (size < image.size && !image.isBusy) void this.shrink(image, size);
    });
    this.missing = growing.length;
    // Those with nothing first, then those that are farthest from what is wanted.
    const urgency = ({ image, size }: { image: StreamedImage; size: number }) =>
      image.size === 0 ? Infinity : size / image.size;
    growing.sort((a, b) => urgency(b) - urgency(a) || 0);
    for (const { image, size } of growing) {
      if (this.active >= PARALLEL) return;
      if (image.size > 0 && !this.isDressed) return;
      if (!image.isBusy) void this.grow(image, size, this.renderer);
    }
  }

  /** The size that each image should have. */
  private sizes(): Map<StreamedImage, number> {
    const images = [...this.images.values()].filter(({ isBroken }) => !isBroken);
    const sizes = planSizes(images, this.limit);
    return new Map(images.map((image, i) => [image, sizes[i] as number]));
  }

  private async shrink(image: StreamedImage, size: number): Promise<void> {
    const { shown } = image;
    if (!shown) return;
    await this.work(image, async () => {
      const picture = await shrunk(shown, size);
      // Some compressed images have no smaller copies in them.
      if (picture === shown) image.least = image.size;
      return picture;
    });
  }

  private async grow(image: StreamedImage, size: number, renderer: WebGLRenderer): Promise<void> {
    await this.work(image, async () => {
      const level = image.levelFor(size);
      const isFirst = image.size === 0;
      const bytes =
        image.kept?.level === level ? image.kept.bytes : await this.read(level, isFirst);
      const whole = await this.decoder.decode(bytes, renderer);
      image.learn(level, whole);
      image.kept = { level, bytes };
      // Only now it is known how large it is.
      const picture = await shrunk(whole, Math.max(this.sizes().get(image) ?? size, 1));
      if (picture !== whole) close(whole);
      return picture;
    });
  }

  /** Shows what a piece of work makes of an image. */
  private async work(
    image: StreamedImage,
    make: () => Promise<Parameters<StreamedImage["show"]>[0]>,
  ): Promise<void> {
    image.isBusy = true;
    ++this.active;
    try {
      const picture = await make();
      if (this.isDisposed) close(picture);
      else if (picture !== image.shown) image.show(picture);
      image.failures = 0;
      image.isBusy = false;
    } catch {
      this.failed(image);
    }
    --this.active;
    if (this.isDisposed) return;
    this.onChange();
    this.plan();
  }

  /** Tries again a little later, some times. */
  private failed(image: StreamedImage): void {
    image.kept = undefined;
    if (++image.failures < TRIES) {
      setTimeout(() => {
        image.isBusy = false;
        this.plan();
      }, RETRY_AFTER);
      return;
    }
    image.isBusy = false;
    image.isBroken = true;
    if (image.size > 0) this.note("A texture stays coarse: a larger copy could not be read.");
    else this.note(`A texture could not be read${image.name && `: ${image.name}`}.`);
  }

  private async read({ file, uri }: ImageLevel, isUrgent: boolean): Promise<Uint8Array> {
    if (file !== undefined) {
      const bytes = await this.stream.readFile(file, isUrgent);
      if (!bytes) throw new Error("an embedded file could not be read");
      return bytes;
    }
    const address = new URL(uri, this.stream.address);
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(`${address} is not there`);
    const bytes = new Uint8Array(await answer.arrayBuffer());
    if (address.protocol !== "data:") this.fetched += bytes.length;
    return bytes;
  }

  dispose(): void {
    this.isDisposed = true;
    for (const image of this.images.values()) image.dispose();
    this.decoder.dispose();
  }
}

/** The image of a texture: that of an extension that names one, where there is any. */
function sourceOf(texture: Json): number {
  const extensions = jsonOf(texture.extensions);
  for (const name of ["KHR_texture_basisu", "EXT_texture_avif", "EXT_texture_webp"]) {
    const source = numberOf(jsonOf(extensions[name]).source, -1);
    if (source >= 0) return source;
  }
  return numberOf(texture.source, -1);
}
