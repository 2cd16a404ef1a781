// Decodes and shrinks images. The browser decodes PNG, JPEG, WebP and AVIF; the Basis transcoder,
// loaded for the first such image, decodes KTX2.

import {
  type CompressedPixelFormat,
  CompressedTexture,
  type CompressedTextureMipmap,
  Texture,
  type WebGLRenderer,
} from "three";
import type { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";
import { UmbelError } from "../../errors.js";

/** An image that the browser decoded, or one of the transcoder, with its mip levels. */
export type DecodedImage = ImageBitmap | Texture;

/** Milliseconds for the transcoding of an image, at most. */
const PATIENCE = 30_000;
const KTX2 = [0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a];
const FORBIDDEN =
  "Textures in KTX2 are not shown: the page's Content-Security-Policy must allow " +
  "worker-src blob: and script-src 'unsafe-eval'.";
const OPTIONS = { colorSpaceConversion: "none", premultiplyAlpha: "none" } as const;

export class ImageDecoder {
  private ktx2: Promise<KTX2Loader> | undefined;
  private readonly basisPath: string;

  /** @param basisPath folder of basis_transcoder.js and .wasm; "" is three.js's own */
  constructor(basisPath: string) {
    // three.js puts the names right behind it.
    this.basisPath = basisPath.replace(/[^/]$/, "$&/");
  }

  /** Rejects if the bytes are not an image of a supported kind. */
  async decode(bytes: Uint8Array, renderer: WebGLRenderer): Promise<DecodedImage> {
    if (KTX2.every((byte, i) => bytes[i] === byte)) {
      this.ktx2 ??= this.loadKtx2(renderer);
      return transcoded(await this.ktx2, bytes.slice().buffer);
    }
    // The browser finds the kind by the first bytes, except for SVG, which glTF does not allow.
    return createImageBitmap(new Blob([bytes as Uint8Array<ArrayBuffer>]), OPTIONS);
  }

  private async loadKtx2(renderer: WebGLRenderer): Promise<KTX2Loader> {
    await checkPolicy();
    try {
      const { KTX2Loader } = await import("three/addons/loaders/KTX2Loader.js");
      const loader = new KTX2Loader().setTranscoderPath(this.basisPath).detectSupport(renderer);
      await loader.init();
      return loader;
    } catch {
      // The next image tries again.
      this.ktx2 = undefined;
      throw new UmbelError("network", "The transcoder of textures could not be loaded.");
    }
  }

  dispose(): void {
    this.ktx2?.then(
      (loader) => loader.dispose(),
      () => {},
    );
  }
}

/** Rejects if a Content-Security-Policy forbids what the transcoder does: three.js would not tell. */
async function checkPolicy(): Promise<void> {
  const address = URL.createObjectURL(new Blob(["new Function(''); postMessage(0);"]));
  let worker: Worker | undefined;
  try {
    await new Promise((resolve, reject) => {
      worker = new Worker(address);
      worker.onmessage = resolve;
      worker.onerror = reject;
    });
  } catch {
    throw new UmbelError("unsupported", FORBIDDEN);
  } finally {
    worker?.terminate();
    URL.revokeObjectURL(address);
  }
}

/** Rejects, too, if the transcoder does not answer: three.js does not tell where its worker fails. */
function transcoded(loader: KTX2Loader, bytes: ArrayBuffer): Promise<Texture> {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error("the transcoder does not answer")), PATIENCE);
    const end = () => clearTimeout(timer);
    loader.parse(
      bytes,
      (texture) => {
        end();
        resolve(texture);
      },
      (error) => {
        end();
        reject(error);
      },
    );
  });
}

/** Width and height, in texels. */
export function extentOf(image: DecodedImage): { width: number; height: number } {
  return image instanceof Texture ? levelsOf(image)[0] : image;
}

/** The longer side, in texels. */
export function sizeOf(image: DecodedImage): number {
  const { width, height } = extentOf(image);
  return Math.max(width, height);
}

/** The mip levels of a transcoded image, largest first. */
function levelsOf(texture: Texture): [CompressedTextureMipmap, ...CompressedTextureMipmap[]] {
  const levels = (texture.mipmaps ?? []) as CompressedTextureMipmap[];
  return levels.length > 0
    ? (levels as [CompressedTextureMipmap])
    : [texture.image as CompressedTextureMipmap];
}

/** A copy with a longer side of `size`, or a little more; the image itself if it is no larger. */
export async function shrunk(image: DecodedImage, size: number): Promise<DecodedImage> {
  const from = sizeOf(image);
  if (from <= size) return image;
  if (image instanceof Texture) return withoutLargest(image, size);
  const [resizeWidth, resizeHeight] = [image.width, image.height].map((side) =>
    Math.max(Math.round((side * size) / from), 1),
  );
  return createImageBitmap(image, {
    ...OPTIONS,
    resizeWidth: resizeWidth as number,
    resizeHeight: resizeHeight as number,
    resizeQuality: "medium",
  });
}

/** A copy without the levels that are larger than needed for `size`. */
function withoutLargest(image: Texture, size: number): Texture {
  const levels = levelsOf(image);
  const sizes = levels.map(({ width, height }) => Math.max(width, height));
  let first = sizes.length - 1;
  while (first > 0 && (sizes[first] as number) < size) --first;
  if (first <= 0 || !(image instanceof CompressedTexture)) return image;
  const { width, height } = levels[first] as CompressedTextureMipmap;
  const format = image.format as CompressedPixelFormat;
  return new CompressedTexture(levels.slice(first), width, height, format, image.type);
}

/** Bytes that an image takes on the GPU. */
export function bytesOf(image: DecodedImage, hasMipmaps: boolean): number {
  if (image instanceof Texture)
    return levelsOf(image).reduce((sum, { data }) => sum + (data?.byteLength ?? 0), 0);
  return texelBytes(image.width, image.height, hasMipmaps);
}

export function texelBytes(width: number, height: number, hasMipmaps: boolean): number {
  return Math.ceil(4 * width * height * (hasMipmaps ? 4 / 3 : 1));
}
