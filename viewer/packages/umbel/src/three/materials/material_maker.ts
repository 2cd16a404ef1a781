// Converts materials of glTF to three.js, without their textures.

import {
  Color,
  DoubleSide,
  FrontSide,
  MeshBasicMaterial,
  MeshPhysicalMaterial,
  MeshStandardMaterial,
  type Side,
  Vector2,
} from "three";
import { isJson, type Json, jsonOf, numberOf, numbersOf, textOf } from "../../format/gltf.js";
import type { VertexLayout } from "../geometry/arena.js";

export const UNLIT = "KHR_materials_unlit";
const STRENGTH = "KHR_materials_emissive_strength";
const GLOSSINESS = "KHR_materials_pbrSpecularGlossiness";

/** The properties of a physical material that each extension sets. */
const PHYSICAL: Record<string, (extension: Json) => Partial<MeshPhysicalMaterial>> = {
  KHR_materials_clearcoat: (from) => ({
    clearcoat: numberOf(from.clearcoatFactor, 0),
    clearcoatRoughness: numberOf(from.clearcoatRoughnessFactor, 0),
    clearcoatNormalScale: scaleOf(from.clearcoatNormalTexture),
  }),
  KHR_materials_transmission: (from) => ({
    transmission: numberOf(from.transmissionFactor, 0),
  }),
  KHR_materials_volume: (from) => ({
    thickness: numberOf(from.thicknessFactor, 0),
    attenuationDistance: numberOf(from.attenuationDistance, 0) || Infinity,
    attenuationColor: colorOf(from.attenuationColor, [1, 1, 1]),
  }),
  KHR_materials_ior: (from) => ({ ior: numberOf(from.ior, 1.5) }),
  KHR_materials_specular: (from) => ({
    specularIntensity: numberOf(from.specularFactor, 1),
    specularColor: colorOf(from.specularColorFactor, [1, 1, 1]),
  }),
  KHR_materials_sheen: (from) => ({
    sheen: 1,
    sheenColor: colorOf(from.sheenColorFactor, [0, 0, 0]),
    sheenRoughness: numberOf(from.sheenRoughnessFactor, 0),
  }),
  KHR_materials_iridescence: (from) => ({
    iridescence: numberOf(from.iridescenceFactor, 0),
    iridescenceIOR: numberOf(from.iridescenceIor, 1.3),
    iridescenceThicknessMinimum: numberOf(from.iridescenceThicknessMinimum, 100),
    iridescenceThicknessMaximum: numberOf(from.iridescenceThicknessMaximum, 400),
  }),
  KHR_materials_anisotropy: (from) => ({
    anisotropy: numberOf(from.anisotropyStrength, 0),
    anisotropyRotation: numberOf(from.anisotropyRotation, 0),
  }),
  KHR_materials_dispersion: (from) => ({ dispersion: numberOf(from.dispersion, 0) }),
};

/** The supported extensions of materials. */
const SUPPORTED = new Set([...Object.keys(PHYSICAL), UNLIT, STRENGTH, GLOSSINESS]);

function colorOf(value: unknown, otherwise: readonly number[]): Color {
  const [r, g, b] = numbersOf(value, otherwise);
  return new Color(r, g, b);
}

function scaleOf(info: unknown): Vector2 {
  return new Vector2().setScalar(numberOf(jsonOf(info).scale, 1));
}

export type AnyMaterial = MeshBasicMaterial | MeshStandardMaterial | MeshPhysicalMaterial;

/** The material of meshes without one. */
export function plainMaterial(layout: VertexLayout): AnyMaterial {
  return new MeshStandardMaterial({
    flatShading: !layout.normals,
    vertexColors: layout.colors,
    color: layout.colors ? 0xffffff : 0xd8d2c8,
    roughness: 0.62,
  });
}

/**
 * Specular and glossiness of a material that has no metal and roughness. Where it has both they look
 * alike, and metal and roughness need no conversion.
 */
export function glossinessOf(gltf: Json): Json | undefined {
  if (Object.keys(jsonOf(gltf.pbrMetallicRoughness)).length > 0) return undefined;
  const glossiness = jsonOf(gltf.extensions)[GLOSSINESS];
  return isJson(glossiness) ? glossiness : undefined;
}

/** @param note is called with a sentence for each property that is not shown */
export function makeMaterial(
  gltf: Json,
  layout: VertexLayout,
  note: (text: string) => void,
): AnyMaterial {
  const extensions = jsonOf(gltf.extensions);
  for (const name of Object.keys(extensions)) {
    if (!SUPPORTED.has(name)) note(`Materials are shown without ${name}.`);
    if (name === GLOSSINESS) note(`${name} is approximated by metal and roughness.`);
  }
  const shared = sharedOf(gltf, layout);
  if (isJson(extensions[UNLIT])) return new MeshBasicMaterial(shared);
  const material = Object.keys(extensions).some((name) => name in PHYSICAL)
    ? new MeshPhysicalMaterial()
    : new MeshStandardMaterial();
  const glossiness = glossinessOf(gltf);
  material.setValues({
    ...shared,
    ...(glossiness ? glossy(glossiness) : metallic(jsonOf(gltf.pbrMetallicRoughness))),
    flatShading: !layout.normals,
    emissive: colorOf(gltf.emissiveFactor, [0, 0, 0]),
    emissiveIntensity: numberOf(jsonOf(extensions[STRENGTH]).emissiveStrength, 1),
    normalScale: scaleOf(gltf.normalTexture),
    aoMapIntensity: numberOf(jsonOf(gltf.occlusionTexture).strength, 1),
  });
  for (const [name, set] of Object.entries(PHYSICAL))
    if (isJson(extensions[name])) Object.assign(material, set(jsonOf(extensions[name])));
  setThicknessRange(material);
  if (!layout.tangents) flipNormalMaps(material);
  return material;
}

/** Before r187 three.js takes the thicknesses of iridescence from an array. */
function setThicknessRange(material: MeshStandardMaterial): void {
  if (!Object.hasOwn(material, "iridescenceThicknessRange")) return;
  const { iridescenceThicknessMinimum: least, iridescenceThicknessMaximum: most } =
    material as MeshPhysicalMaterial;
  if (least !== undefined && most !== undefined)
    Object.assign(material, { iridescenceThicknessRange: [least, most] });
}

/** three.js derives bitangents from texture coordinates; they are the opposite of glTF's. */
function flipNormalMaps(material: MeshStandardMaterial): void {
  material.normalScale.y *= -1;
  if (material instanceof MeshPhysicalMaterial) material.clearcoatNormalScale.y *= -1;
}

export function sideOf(gltf: Json): Side {
  return gltf.doubleSided === true ? DoubleSide : FrontSide;
}

/** The properties of materials of all kinds. */
function sharedOf(gltf: Json, { colors }: VertexLayout) {
  const pbr = jsonOf(gltf.pbrMetallicRoughness);
  const glossiness = glossinessOf(gltf) ?? {};
  const [r, g, b, a] = numbersOf(pbr.baseColorFactor ?? glossiness.diffuseFactor, [1, 1, 1, 1]);
  // A blended material that is nowhere transparent is drawn as an opaque one.
  const mayBeTransparent = (a as number) < 1 || isJson(pbr.baseColorTexture) || colors;
  const isBlended =
    gltf.alphaMode === "BLEND" && (mayBeTransparent || "diffuseTexture" in glossiness);
  return {
    name: textOf(gltf.name),
    color: new Color(r, g, b),
    vertexColors: colors,
    side: sideOf(gltf),
    // Batch draws both sides in its own call, after three.js's.
    forceSinglePass: true,
    transparent: isBlended,
    depthWrite: !isBlended,
    opacity: isBlended || gltf.alphaMode === "MASK" ? (a as number) : 1,
    alphaTest: gltf.alphaMode === "MASK" ? numberOf(gltf.alphaCutoff, 0.5) : 0,
  };
}

function metallic(pbr: Json) {
  return {
    metalness: numberOf(pbr.metallicFactor, 1),
    roughness: numberOf(pbr.roughnessFactor, 1),
  };
}

function glossy(glossiness: Json) {
  return { metalness: 0, roughness: 1 - numberOf(glossiness.glossinessFactor, 1) };
}
