// Where textures of glTF's materials go in those of three.js, extensions included.

import { type Json, jsonOf } from "../../format/gltf.js";
import type { Neutral } from "../textures/textures.js";

export interface Slot {
  /** Where the material has it: in itself, its metallic-roughness part, or an extension. */
  part: string;
  name: string;
  slots: readonly string[];
  isColor: boolean;
  neutral: Neutral;
}

function slot(path: string, slots: string, kind: "color" | "data" | Neutral = "data"): Slot {
  const [name = "", part = ""] = path.split("/").reverse();
  const neutral = kind === "color" || kind === "data" ? "white" : kind;
  return { part, name, slots: slots.split(" "), isColor: kind === "color", neutral };
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

/** What a material says of a slot's texture; undefined where it has none. */
export function textureInfo(material: Json, { part, name }: Slot): Json | undefined {
  const inside = part === "" ? material : part === METALLIC ? material[part] : inExtension();
  const info = jsonOf(inside)[name];
  return info === undefined || info === null ? undefined : jsonOf(info);

  function inExtension(): unknown {
    return jsonOf(material.extensions)[part];
  }
}
