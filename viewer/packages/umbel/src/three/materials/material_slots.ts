// Maps textures of glTF's materials to the slots of three.js's, extensions included.

import { type Json, jsonOf } from "../../format/gltf.js";
import type { Placeholder } from "../textures/placeholders.js";

/** A texture of glTF's materials, and the slots of three.js's that take it. */
export interface Slot {
  /** Where the glTF material has the texture: at its top (""), in a part, or in an extension. */
  part: string;
  name: string;
  slots: readonly string[];
  isColor: boolean;
  placeholder: Placeholder;
}

function slot(path: string, slots: string, kind: "color" | "data" | Placeholder = "data"): Slot {
  const [name = "", part = ""] = path.split("/").reverse();
  const placeholder = kind === "color" || kind === "data" ? "white" : kind;
  return { part, name, slots: slots.split(" "), isColor: kind === "color", placeholder };
}

const METALLIC = "pbrMetallicRoughness";
const EMISSIVE = { ...slot("emissiveTexture", "emissiveMap", "black"), isColor: true };

export const BASE_COLOR = slot(`${METALLIC}/baseColorTexture`, "map", "color");
export const STANDARD: readonly Slot[] = [
  BASE_COLOR,
  slot(`${METALLIC}/metallicRoughnessTexture`, "metalnessMap roughnessMap"),
  slot("normalTexture", "normalMap", "normal"),
  slot("occlusionTexture", "aoMap"),
  EMISSIVE,
];

const CLEARCOAT = "KHR_materials_clearcoat";
const SPECULAR = "KHR_materials_specular";
const SHEEN = "KHR_materials_sheen";
const IRIDESCENCE = "KHR_materials_iridescence";

export const PHYSICAL: readonly Slot[] = [
  slot(`${CLEARCOAT}/clearcoatTexture`, "clearcoatMap"),
  slot(`${CLEARCOAT}/clearcoatRoughnessTexture`, "clearcoatRoughnessMap"),
  slot(`${CLEARCOAT}/clearcoatNormalTexture`, "clearcoatNormalMap", "normal"),
  slot("KHR_materials_transmission/transmissionTexture", "transmissionMap"),
  slot("KHR_materials_volume/thicknessTexture", "thicknessMap"),
  slot(`${SPECULAR}/specularTexture`, "specularIntensityMap"),
  slot(`${SPECULAR}/specularColorTexture`, "specularColorMap", "color"),
  slot(`${SHEEN}/sheenColorTexture`, "sheenColorMap", "color"),
  slot(`${SHEEN}/sheenRoughnessTexture`, "sheenRoughnessMap"),
  slot(`${IRIDESCENCE}/iridescenceTexture`, "iridescenceMap"),
  slot(`${IRIDESCENCE}/iridescenceThicknessTexture`, "iridescenceThicknessMap"),
  slot("KHR_materials_anisotropy/anisotropyTexture", "anisotropyMap", "direction"),
];

/** glTF's textureInfo of a slot; undefined where the material has none. */
export function textureInfo(material: Json, { part, name }: Slot): Json | undefined {
  const owner = part === "" ? material : part === METALLIC ? material[part] : extensionOf();
  const info = jsonOf(owner)[name];
  return info === undefined || info === null ? undefined : jsonOf(info);

  function extensionOf(): unknown {
    return jsonOf(material.extensions)[part];
  }
}
