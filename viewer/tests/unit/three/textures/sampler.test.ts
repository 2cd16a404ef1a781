import { Texture } from "three";
import { describe, expect, test } from "vitest";
import {
  applySampler,
  channelOf,
  repeatsOf,
} from "../../../../packages/umbel/src/three/textures/sampler.js";

describe("a sampler", () => {
  test("has the set, the transform and the filters of its textureInfo", () => {
    const info = {
      index: 0,
      texCoord: 0,
      extensions: {
        KHR_texture_transform: { offset: [0.5, 0.25], scale: [2, -4], rotation: 1, texCoord: 1 },
      },
    };
    const texture = new Texture();
    applySampler(
      texture,
      { wrapS: 33071, wrapT: 33648, magFilter: 9728, minFilter: 9729 },
      info,
      true,
    );
    expect(texture).toMatchObject({
      channel: 1,
      rotation: 1,
      wrapS: 1001,
      wrapT: 1002,
      magFilter: 1003,
      minFilter: 1006,
      generateMipmaps: false,
      flipY: false,
      colorSpace: "srgb",
    });
    expect(texture.offset.toArray()).toEqual([0.5, 0.25]);
    expect(texture.repeat.toArray()).toEqual([2, -4]);
    expect(repeatsOf(info)).toBe(2);
    const plain = new Texture();
    applySampler(plain, {}, {}, false);
    expect(plain).toMatchObject({
      channel: 0,
      wrapS: 1000,
      wrapT: 1000,
      magFilter: 1006,
      minFilter: 1008,
      generateMipmaps: true,
      colorSpace: "",
    });
  });

  test("takes the transform's set before the texture's", () => {
    expect(channelOf({ texCoord: 2 })).toBe(2);
    expect(channelOf({ texCoord: 2, extensions: { KHR_texture_transform: {} } })).toBe(2);
    expect(channelOf({ texCoord: 2, extensions: { KHR_texture_transform: { texCoord: 0 } } })).toBe(
      0,
    );
  });
});
