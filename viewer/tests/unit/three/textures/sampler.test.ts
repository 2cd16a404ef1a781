import { Matrix3, Texture, Vector2 } from "three";
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
      matrixAutoUpdate: false,
      wrapS: 1001,
      wrapT: 1002,
      magFilter: 1003,
      minFilter: 1006,
      generateMipmaps: false,
      flipY: false,
      colorSpace: "srgb",
    });
    // Scaled, then rotated, then moved.
    const [c, s] = [Math.cos(1), Math.sin(1)];
    const at = new Vector2(3, 5).applyMatrix3(texture.matrix);
    expect(at.x).toBeCloseTo(c * 6 + s * -20 + 0.5, 12);
    expect(at.y).toBeCloseTo(-s * 6 + c * -20 + 0.25, 12);
    expect(repeatsOf(info)).toBe(2);
    const plain = new Texture();
    applySampler(plain, {}, {}, false);
    expect(plain.matrix.equals(new Matrix3())).toBe(true);
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
