import { MeshBasicMaterial, MeshPhysicalMaterial, MeshStandardMaterial, Texture } from "three";
import { describe, expect, test } from "vitest";
import type { Json } from "../../../../packages/umbel/src/format/gltf.js";
import type { AssetInfo } from "../../../../packages/umbel/src/stream/asset_info.js";
import { makeMaterial } from "../../../../packages/umbel/src/three/materials/material_maker.js";
import {
  PHYSICAL,
  STANDARD,
  textureInfo,
} from "../../../../packages/umbel/src/three/materials/material_slots.js";
import { unsupportedFeatures } from "../../../../packages/umbel/src/three/materials/unsupported.js";
import {
  applySampler,
  channelOf,
  repeatsOf,
} from "../../../../packages/umbel/src/three/textures/sampler.js";

const LAYOUT = { normals: true, tangents: true, uvs: [true, true, false, false], colors: false };

function make(gltf: Json, colors = false): { material: MeshPhysicalMaterial; notes: string[] } {
  const notes: string[] = [];
  const material = makeMaterial(gltf, { ...LAYOUT, colors }, (text) => notes.push(text));
  return { material: material as MeshPhysicalMaterial, notes };
}

describe("materials", () => {
  test("are of three.js's kinds", () => {
    expect(make({}).material).toBeInstanceOf(MeshStandardMaterial);
    expect(make({}).material).not.toBeInstanceOf(MeshPhysicalMaterial);
    expect(make({ extensions: { KHR_materials_unlit: {} } }).material).toBeInstanceOf(
      MeshBasicMaterial,
    );
    expect(make({ extensions: { KHR_materials_ior: {} } }).material).toBeInstanceOf(
      MeshPhysicalMaterial,
    );
  });

  test("have what the extensions say", () => {
    const { material, notes } = make({
      emissiveFactor: [1, 0.5, 0],
      extensions: {
        KHR_materials_clearcoat: {
          clearcoatFactor: 0.5,
          clearcoatRoughnessFactor: 0.25,
          clearcoatNormalTexture: { scale: 2 },
        },
        KHR_materials_transmission: { transmissionFactor: 0.75 },
        KHR_materials_volume: {
          thicknessFactor: 2,
          attenuationDistance: 3,
          attenuationColor: [1, 0, 0.5],
        },
        KHR_materials_ior: { ior: 1.25 },
        KHR_materials_specular: { specularFactor: 0.5, specularColorFactor: [0, 1, 0] },
        KHR_materials_sheen: { sheenColorFactor: [0.5, 0, 0], sheenRoughnessFactor: 0.125 },
        KHR_materials_iridescence: {
          iridescenceFactor: 1,
          iridescenceIor: 1.5,
          iridescenceThicknessMinimum: 50,
          iridescenceThicknessMaximum: 900,
        },
        KHR_materials_anisotropy: { anisotropyStrength: 0.5, anisotropyRotation: 0.25 },
        KHR_materials_dispersion: { dispersion: 0.5 },
        KHR_materials_emissive_strength: { emissiveStrength: 4 },
      },
    });
    expect(notes).toEqual([]);
    expect(material).toMatchObject({
      clearcoat: 0.5,
      clearcoatRoughness: 0.25,
      transmission: 0.75,
      thickness: 2,
      attenuationDistance: 3,
      specularIntensity: 0.5,
      sheen: 1,
      sheenRoughness: 0.125,
      iridescence: 1,
      iridescenceIOR: 1.5,
      iridescenceThicknessMinimum: 50,
      iridescenceThicknessMaximum: 900,
      anisotropy: 0.5,
      anisotropyRotation: 0.25,
      dispersion: 0.5,
      emissiveIntensity: 4,
    });
    expect(material.ior).toBeCloseTo(1.25);
    expect(material.clearcoatNormalScale.x).toBe(2);
    expect(material.attenuationColor.toArray()).toEqual([1, 0, 0.5]);
    expect(material.specularColor.toArray()).toEqual([0, 1, 0]);
    expect(material.emissive.toArray()).toEqual([1, 0.5, 0]);
  });

  test("have normal maps that point as glTF's do, with tangents of the mesh or without", () => {
    const coat = { clearcoatNormalTexture: { scale: 3 } };
    const gltf = { normalTexture: { scale: 2 }, extensions: { KHR_materials_clearcoat: coat } };
    for (const [tangents, sign] of [
      [true, 1],
      [false, -1],
    ] as const) {
      const made = makeMaterial(gltf, { ...LAYOUT, tangents }, () => {}) as MeshPhysicalMaterial;
      expect(made.normalScale.toArray()).toEqual([2, 2 * sign]);
      expect(made.clearcoatNormalScale.toArray()).toEqual([3, 3 * sign]);
    }
  });

  test("that cannot be shown whole say so", () => {
    const { notes } = make({ extensions: { KHR_materials_unheard_of: {} } });
    expect(notes).toEqual(["Materials are shown without KHR_materials_unheard_of."]);
  });

  test("let through what glTF says", () => {
    const half = { pbrMetallicRoughness: { baseColorFactor: [1, 1, 1, 0.5] } };
    expect(make({ ...half, alphaMode: "BLEND" }).material).toMatchObject({
      transparent: true,
      opacity: 0.5,
      depthWrite: false,
    });
    expect(make({ ...half, alphaMode: "OPAQUE" }).material).toMatchObject({
      transparent: false,
      opacity: 1,
    });
    expect(make({ alphaMode: "BLEND" }).material.transparent).toBe(false);
    expect(make({ alphaMode: "BLEND" }, true).material.transparent).toBe(true);
    expect(make({ alphaMode: "MASK" }).material).toMatchObject({
      transparent: false,
      alphaTest: 0.5,
    });
    expect(make({ alphaMode: "MASK", alphaCutoff: 0.25 }).material.alphaTest).toBe(0.25);
  });

  test("of any JSON are made without an error", () => {
    const odd = [null, true, -1, Infinity, "x", [], [null], {}, { index: "x" }, [1, "2", null]];
    const names = [
      "pbrMetallicRoughness",
      "normalTexture",
      "emissiveFactor",
      "alphaMode",
      "extensions",
      "name",
      "doubleSided",
    ];
    for (const name of names)
      for (const value of odd) expect(() => make({ [name]: value })).not.toThrow();
    for (const { part } of PHYSICAL)
      for (const value of odd) {
        expect(() => make({ extensions: { [part]: value } })).not.toThrow();
        for (const slot of [...STANDARD, ...PHYSICAL])
          expect(() => textureInfo({ extensions: { [part]: value } }, slot)).not.toThrow();
      }
  });
});

test("what an asset has that nothing is shown of is said", () => {
  const meshes = [{ skipped: ["joints", "texture coordinates"] }];
  const scene = { extensions: { KHR_lights_punctual: { lights: [] } } };
  const said = unsupportedFeatures({ meshes, scene } as unknown as AssetInfo);
  expect(said.map((text) => /joints|lights/.exec(text)?.[0])).toEqual(["joints", "lights"]);
  expect(
    unsupportedFeatures({ meshes: [{ skipped: [] }], scene: {} } as unknown as AssetInfo),
  ).toEqual([]);
});

describe("textures are looked up as glTF says", () => {
  test("each slot by its own set, transform and sampler", () => {
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

  test("where the transform's set wins over the texture's", () => {
    expect(channelOf({ texCoord: 2 })).toBe(2);
    expect(channelOf({ texCoord: 2, extensions: { KHR_texture_transform: {} } })).toBe(2);
    expect(channelOf({ texCoord: 2, extensions: { KHR_texture_transform: { texCoord: 0 } } })).toBe(
      0,
    );
  });
});
