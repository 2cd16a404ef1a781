import { MeshBasicMaterial, MeshPhysicalMaterial, MeshStandardMaterial } from "three";
import { describe, expect, test } from "vitest";
import type { Json } from "../../../../packages/umbel/src/format/gltf.js";
import { makeMaterial } from "../../../../packages/umbel/src/three/materials/material_maker.js";
import {
  PHYSICAL,
  STANDARD,
  textureInfo,
} from "../../../../packages/umbel/src/three/materials/material_slots.js";

const LAYOUT = { normals: true, tangents: true, uvs: [true, true, false, false], colors: false };

function make(gltf: Json, colors = false): { material: MeshPhysicalMaterial; notes: string[] } {
  const notes: string[] = [];
  const material = makeMaterial(gltf, { ...LAYOUT, colors }, (text) => notes.push(text));
  return { material: material as MeshPhysicalMaterial, notes };
}

describe("materials", () => {
  test("have the class that their extensions need", () => {
    expect(make({}).material).toBeInstanceOf(MeshStandardMaterial);
    expect(make({}).material).not.toBeInstanceOf(MeshPhysicalMaterial);
    expect(make({ extensions: { KHR_materials_unlit: {} } }).material).toBeInstanceOf(
      MeshBasicMaterial,
    );
    expect(make({ extensions: { KHR_materials_ior: {} } }).material).toBeInstanceOf(
      MeshPhysicalMaterial,
    );
  });

  test("have the values of their extensions", () => {
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

  test("have glTF's normal maps, with tangents of the mesh or without", () => {
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

  test("have specular and glossiness where they have no metal and roughness", () => {
    const glossiness = { diffuseFactor: [0.5, 0, 0, 1], glossinessFactor: 0.75 };
    const extensions = { KHR_materials_pbrSpecularGlossiness: glossiness };
    const alone = make({ extensions });
    expect(alone.notes.length).toBe(1);
    expect(alone.material).toMatchObject({ metalness: 0, roughness: 0.25 });
    expect(alone.material.color.toArray()).toEqual([0.5, 0, 0]);
    const pbrMetallicRoughness = { metallicFactor: 0.875, roughnessFactor: 0.5 };
    const both = make({ pbrMetallicRoughness, extensions }).material;
    expect(both).toMatchObject({ metalness: 0.875, roughness: 0.5 });
    expect(both.color.toArray()).toEqual([1, 1, 1]);
  });

  test("report extensions that are not shown", () => {
    const { notes } = make({ extensions: { KHR_materials_unheard_of: {} } });
    expect(notes).toEqual(["Materials are shown without KHR_materials_unheard_of."]);
  });

  test("have the transparency of their alpha mode", () => {
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

  test("are made of any JSON without an error", () => {
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
