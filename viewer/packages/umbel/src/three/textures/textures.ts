// Streams the textures of an asset. The smallest copies of all visible images come first, then larger
// ones, as large as they are visible and as the memory allows.

import type { Material, WebGLRenderer } from "three";
import { UmbelError } from "../../errors.js";
import { type Json, jsonOf, listOf, numberOf } from "../../format/gltf.js";
import { readWhole } from "../../source/patient_fetch.js";
import type { AssetStream } from "../../worker/asset_stream.js";
import { type DecodedImage, ImageDecoder, shrunk } from "./image_decoder.js";
import { type Placeholder, placeholderImage } from "./placeholders.js";
import { channelOf, repeatsOf } from "./sampler.js";
import { close, type ImageLevel, StreamedImage } from "./streamed_image.js";
import type { TexelsByMaterial } from "./texel_demand.js";
import { planSizes } from "./texture_plan.js";

/** Number of images that are read or decoded at the same time. */
const MAX_ACTIVE = 3;
/** Attempts to read an image before it is given up, or is late if its server does not answer. */
const MAX_ATTEMPTS = 2;
/** Milliseconds until the second attempt; each further delay is twice as long, up to the most. */
const RETRY_DELAY = 1500;
const MAX_RETRY_DELAY = 24_000;
const LATE = "Textures are late: they are requested again until they arrive.";

export interface TextureStatistics {
  /** Memory of the resident ones. */
  bytes: number;
  /** Numbers of images: in use, resident, and still to arrive or to grow. */
  images: number;
  resident: number;
  missing: number;
  /** Whether every visible image has a copy of some size. */
  isComplete: boolean;
  /** Bytes received of images outside of the asset's file. */
  fetchedBytes: number;
}

export class Textures {
  /** Bytes of memory that textures may take. */
  limit = Infinity;
  private readonly textures: Json[];
  private readonly samplers: Json[];
  private readonly imageRows: Json[];
  private readonly images = new Map<number, StreamedImage>();
  /** For each material its images, and each one's repeats and set of texture coordinates. */
  private readonly usedBy = new Map<
    number,
    { image: StreamedImage; repeats: number; set: number }[]
  >();
  private readonly decoder: ImageDecoder;
  private renderer: WebGLRenderer | undefined;
  private active = 0;
  private missing = 0;
  /** Whether a frame began with a copy of every visible image; larger copies wait for that. */
  private hasAllSmall = false;
  private fetched = 0;
  /** Aborted when the textures are disposed of. */
  private readonly aborter = new AbortController();

  /**
   * @param onChange is called when a texture has arrived or changed its size
   * @param note is called with sentences about what is not shown, and when one no longer holds
   */
  constructor(
    private readonly stream: AssetStream,
    basisPath: string,
    private readonly onChange: () => void,
    private readonly note: (text: string, holds?: boolean) => void,
  ) {
    const { textures, samplers, images } = stream.info.materials;
    this.textures = listOf(textures);
    this.samplers = listOf(samplers);
    this.imageRows = listOf(images);
    this.decoder = new ImageDecoder(basisPath);
  }

  /** Whether the asset has images. */
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

  /** Puts a texture of glTF into slots of a material; false if the asset has no such texture. */
  use(
    materialIndex: number,
    material: Material,
    slots: readonly string[],
    info: Json,
    isColor: boolean,
    placeholder: Placeholder,
  ): boolean {
    const texture = this.textures[numberOf(info.index, -1)];
    const image = texture && this.image(sourceOf(texture));
    if (!image) return false;
    const sampler = this.samplers[numberOf(texture.sampler, -1)] ?? {};
    image.use(material, slots, {
      sampler,
      info,
      isColor,
      placeholder: placeholderImage(placeholder),
    });
    const used = this.usedBy.get(materialIndex) ?? [];
    used.push({ image, repeats: repeatsOf(info), set: channelOf(info) });
    this.usedBy.set(materialIndex, used);
    return true;
  }

  private image(index: number): StreamedImage | undefined {
    const row = this.imageRows[index];
    if (!row) return undefined;
    let image = this.images.get(index);
    if (!image) {
      image = new StreamedImage(row);
      this.images.set(index, image);
      if (image.isBroken) this.note("The asset has textures without an image file.");
    }
    return image;
  }

  /**
   * Sets the resolution at which textures are needed, and plans again.
   * @param demand for each visible material and set of texture coordinates the texels of a whole
   *   texture, at one texel a pixel
   */
  setDemand(demand: TexelsByMaterial, renderer: WebGLRenderer): void {
    this.renderer = renderer;
    for (const image of this.images.values()) image.wanted = 0;
    for (const [material, texels] of demand)
      for (const { image, repeats, set } of this.usedBy.get(material) ?? [])
        image.wanted = Math.max(image.wanted, (texels[set] ?? 0) / repeats, 1);
    this.plan();
  }

  /** To be called before each frame that draws clusters. */
  beginFrame(): void {
    if (this.hasAllSmall || !this.isComplete) return;
    this.hasAllSmall = true;
    this.plan();
  }

  /** Whether every visible image has a copy of some size, or cannot be read. */
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
    // Images without a copy come first, then those that are to grow by the largest factor.
    const priority = ({ image, size }: { image: StreamedImage; size: number }) =>
      image.size === 0 ? Infinity : size / image.size;
    growing.sort((a, b) => priority(b) - priority(a) || 0);
    for (const { image, size } of growing) {
      if (this.active >= MAX_ACTIVE) return;
      if (image.size > 0 && !this.hasAllSmall) return;
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
    await this.replace(image, async () => {
      const decoded = await shrunk(shown, size);
      // Some compressed images have no smaller levels.
      if (decoded === shown) image.smallest = image.size;
      return decoded;
    });
  }

  private async grow(image: StreamedImage, size: number, renderer: WebGLRenderer): Promise<void> {
    await this.replace(image, async () => {
      const level = image.levelFor(size);
      const isFirst = image.size === 0;
      const bytes =
        image.kept?.level === level ? image.kept.bytes : await this.read(level, isFirst);
      const full = await this.decoder.decode(bytes, renderer);
      image.setDecodedSize(level, full);
      image.kept = { level, bytes };
      // The plan may change now: the true size is known.
      const decoded = await shrunk(full, Math.max(this.sizes().get(image) ?? size, 1));
      if (decoded !== full) close(full);
      return decoded;
    });
  }

  /** Replaces the shown copy of an image by the one that `make` returns. */
  private async replace(image: StreamedImage, make: () => Promise<DecodedImage>): Promise<void> {
    image.isBusy = true;
    ++this.active;
    try {
      const decoded = await make();
      if (this.isDisposed) close(decoded);
      else if (decoded !== image.shown) image.show(decoded);
      image.failures = 0;
      image.isBusy = false;
      if (!this.isLate) this.note(LATE, false);
    } catch (error) {
      this.failed(image, error instanceof UmbelError ? error : undefined);
    }
    --this.active;
    if (this.isDisposed) return;
    this.onChange();
    this.plan();
  }

  /** Whether an image waits for a server that does not answer. */
  private get isLate(): boolean {
    return [...this.images.values()].some(
      ({ failures, isBusy }) => isBusy && failures >= MAX_ATTEMPTS,
    );
  }

  private get isDisposed(): boolean {
    return this.aborter.signal.aborted;
  }

  /** Tries again later, or gives up. */
  private failed(image: StreamedImage, error: UmbelError | undefined): void {
    if (this.isDisposed) return;
    const isLost = error?.kind === "network";
    const isHopeless = error?.kind === "unsupported";
    image.kept = undefined;
    const isLast = ++image.failures >= MAX_ATTEMPTS || isHopeless;
    // Other images do not wait for one that is late.
    image.isBroken = isLast;
    if (isLost || !isLast) {
      if (isLast) this.note(LATE);
      const delay = RETRY_DELAY * 2 ** (image.failures - 1);
      setTimeout(
        () => {
          image.isBusy = image.isBroken = false;
          this.plan();
        },
        Math.min(delay, MAX_RETRY_DELAY),
      );
      return;
    }
    image.isBusy = false;
    if (isHopeless) this.note(error.message);
    else if (image.size > 0) this.note("A texture stays coarse: a larger copy could not be read.");
    else this.note(`A texture could not be read${image.name && `: ${image.name}`}.`);
  }

  private async read({ file, uri }: ImageLevel, isUrgent: boolean): Promise<Uint8Array> {
    if (file !== undefined) return this.stream.readFile(file, isUrgent);
    const address = new URL(uri, this.stream.address);
    const bytes = await readWhole(address.href, this.aborter.signal);
    if (address.protocol !== "data:") this.fetched += bytes.length;
    return bytes;
  }

  dispose(): void {
    this.aborter.abort();
    for (const image of this.images.values()) image.dispose();
    this.decoder.dispose();
  }
}

/** The image of a texture; an extension's image comes first. */
function sourceOf(texture: Json): number {
  const extensions = jsonOf(texture.extensions);
  for (const name of ["KHR_texture_basisu", "EXT_texture_avif", "EXT_texture_webp"]) {
    const source = numberOf(jsonOf(extensions[name]).source, -1);
    if (source >= 0) return source;
  }
  return numberOf(texture.source, -1);
}
