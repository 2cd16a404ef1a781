// Converts glTF's samplers and texture transforms to three.js.

import {
  ClampToEdgeWrapping,
  LinearFilter,
  LinearMipmapLinearFilter,
  LinearMipmapNearestFilter,
  type MagnificationTextureFilter,
  type MinificationTextureFilter,
  MirroredRepeatWrapping,
  NearestFilter,
  NearestMipmapLinearFilter,
  NearestMipmapNearestFilter,
  RepeatWrapping,
  SRGBColorSpace,
  type Texture,
  type Wrapping,
} from "three";
import { type Json, jsonOf, numberOf, numbersOf } from "../../format/gltf.js";

const ANISOTROPY = 4;
const WRAPS = new Map<unknown, Wrapping>([
  [33071, ClampToEdgeWrapping],
  [33648, MirroredRepeatWrapping],
]);
const MAG_FILTERS = new Map<unknown, MagnificationTextureFilter>([[9728, NearestFilter]]);
const MIN_FILTERS = new Map<unknown, MinificationTextureFilter>([
  [9728, NearestFilter],
  [9729, LinearFilter],
  [9984, NearestMipmapNearestFilter],
  [9985, LinearMipmapNearestFilter],
  [9986, NearestMipmapLinearFilter],
]);

export function hasMipmaps(sampler: Json): boolean {
  return sampler.minFilter !== 9728 && sampler.minFilter !== 9729;
}

/** Number of repeats of a texture over the unit range of coordinates, along the axis with fewer. */
export function repeatsOf(info: Json): number {
  const [x = 1, y = 1] = numbersOf(transformOf(info).scale, [1, 1]);
  return Math.max(Math.min(Math.abs(x), Math.abs(y)), 1e-6);
}

/** The set of texture coordinates that a textureInfo uses. */
export function channelOf(info: Json): number {
  return numberOf(transformOf(info).texCoord, numberOf(info.texCoord, 0));
}

function transformOf(info: Json): Json {
  return jsonOf(jsonOf(info.extensions).KHR_texture_transform);
}

export function applySampler(texture: Texture, sampler: Json, info: Json, isColor: boolean): void {
  texture.wrapS = WRAPS.get(sampler.wrapS) ?? RepeatWrapping;
  texture.wrapT = WRAPS.get(sampler.wrapT) ?? RepeatWrapping;
  texture.magFilter = MAG_FILTERS.get(sampler.magFilter) ?? LinearFilter;
  texture.minFilter = MIN_FILTERS.get(sampler.minFilter) ?? LinearMipmapLinearFilter;
  texture.generateMipmaps = hasMipmaps(sampler);
  if (texture.minFilter === LinearMipmapLinearFilter) texture.anisotropy = ANISOTROPY;
  texture.flipY = false;
  if (isColor) texture.colorSpace = SRGBColorSpace;
  texture.channel = channelOf(info);
  const transform = transformOf(info);
  const [offsetX = 0, offsetY = 0] = numbersOf(transform.offset, [0, 0]);
  const [scaleX = 1, scaleY = 1] = numbersOf(transform.scale, [1, 1]);
  const rotation = numberOf(transform.rotation, 0);
  const [c, s] = [Math.cos(rotation), Math.sin(rotation)];
  // glTF scales, then rotates; the fields of three.js's textures do so in the other order.
  texture.matrixAutoUpdate = false;
  texture.matrix.set(c * scaleX, s * scaleY, offsetX, -s * scaleX, c * scaleY, offsetY, 0, 0, 1);
}
