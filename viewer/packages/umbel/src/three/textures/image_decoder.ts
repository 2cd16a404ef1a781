// Makes pictures of an image's bytes: the browser decodes PNG, JPEG, WebP and AVIF; KTX2 is decoded
// by the Basis transcoder, which is loaded when the first such image comes.

import {
  type CompressedPixelFormat,
  CompressedTexture,
  type CompressedTextureMipmap,
  Texture,
  type WebGLRenderer,
} from "three";
import type { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";

/** As the browser decodes one, or as the transcoder makes one, with its mip levels. */
export type Picture = ImageBitmap | Texture;

const KTX2 = [0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a];
const OPTIONS = { colorSpaceConversion: "none", premultiplyAlpha: "none" } as const;

export class ImageDecoder {
  private ktx2: Promise<KTX2Loader> | undefined;

  /** @param basisPath the folder of basis_transcoder.js and .wasm; "" is where three.js has them */
  constructor(private readonly basisPath: string) {}

  /** Rejects where the bytes are no image that can be shown here. */
  async decode(bytes: Uint8Array, renderer: WebGLRenderer): Promise<Picture> {
    if (KTX2.every((byte, i) => bytes[i] === byte)) {
      this.ktx2 ??= this.loadKtx2(renderer);
      const loader = await this.ktx2;
      const buffer = bytes.slice().buffer;
      return new Promise((resolve, reject) => {
        loader.parse(buffer, resolve, reject);
      });
    }
    // The browser finds out what it is by the first bytes, but for SVG, which glTF does not have.
    return createImageBitmap(new Blob([bytes as Uint8Array<ArrayBuffer>]), OPTIONS);
  }

  private async loadKtx2(renderer: WebGLRenderer): Promise<KTX2Loader> {
    const { KTX2Loader } = await import("three/addons/loaders/KTX2Loader.js");
    return new KTX2Loader().setTranscoderPath(this.basisPath).detectSupport(renderer);
  }

  dispose(): void {
    void this.ktx2?.then((loader) => loader.dispose());
  }
}

/** Width and height, in texels. */
export function extentOf(picture: Picture): { width: number; height: number } {
  return picture instanceof Texture ? levelsOf(picture)[0] : picture;
}

/** The longer side, in texels. */
export function sizeOf(picture: Picture): number {
  const { width, height } = extentOf(picture);
  return Math.max(width, height);
}

/** The mip levels of what the transcoder made, largest first. */
function levelsOf(texture: Texture): [CompressedTextureMipmap, ...CompressedTextureMipmap[]] {
  const levels = (texture.mipmaps ?? []) as CompressedTextureMipmap[];
  return levels.length > 0
    ? (levels as [CompressedTextureMipmap])
    : [texture.image as CompressedTextureMipmap];
}

/** A copy with a longer side of `size`, or a little more; the picture itself where it is no larger. */
export async function shrunk(picture: Picture, size: number): Promise<Picture> {
  const from = sizeOf(picture);
  if (from <= size) return picture;
  if (picture instanceof Texture) return withoutLargest(picture, size);
  const [resizeWidth, resizeHeight] = [picture.width, picture.height].map((side) =>
    Math.max(Math.round((side * size) / from), 1),
  );
  return createImageBitmap(picture, {
    ...OPTIONS,
    resizeWidth: resizeWidth as number,
    resizeHeight: resizeHeight as number,
    resizeQuality: "medium",
  });
}

/** Without the largest of its levels, as long as what is left is large enough. */
function withoutLargest(picture: Texture, size: number): Texture {
  const levels = levelsOf(picture);
  const sizes = levels.map(({ width, height }) => Math.max(width, height));
  let first = sizes.length - 1;
  while (first > 0 && (sizes[first] as number) < size) --first;
  if (first <= 0 || !(picture instanceof CompressedTexture)) return picture;
  const { width, height } = levels[first] as CompressedTextureMipmap;
  const format = picture.format as CompressedPixelFormat;
  return new CompressedTexture(levels.slice(first), width, height, format, picture.type);
}

/** Bytes that a picture takes on the GPU. */
export function bytesOf(picture: Picture, hasMipmaps: boolean): number {
  if (picture instanceof Texture)
    return levelsOf(picture).reduce((sum, { data }) => sum + (data?.byteLength ?? 0), 0);
  return texelBytes(picture.width, picture.height, hasMipmaps);
}

export function texelBytes(width: number, height: number, hasMipmaps: boolean): number {
  return Math.ceil(4 * width * height * (hasMipmaps ? 4 / 3 : 1));
}
