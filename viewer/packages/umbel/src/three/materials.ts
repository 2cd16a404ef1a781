// Materials of three.js for those that an asset names in its metadata.

import { Color, DoubleSide, FrontSide, type Material, MeshStandardMaterial } from "three";
import type { AssetInfo } from "../streamer.js";

/** What the metadata may say of a material: names and meanings are glTF's. */
interface Described {
  name?: string;
  base_color?: number[];
  metallic?: number;
  roughness?: number;
  emissive?: number[];
  alpha_mode?: string;
  alpha_cutoff?: number;
  double_sided?: boolean;
}

/** One material for each that the clusters may name; at least one. */
export function makeMaterials(info: AssetInfo): Material[] {
  const described = Array.isArray(info.metadata.materials)
    ? (info.metadata.materials as Described[])
    : [];
  const common = {
    flatShading: !info.attributes.includes("normals"),
    vertexColors: info.attributes.includes("colors"),
  };
  if (described.length === 0)
    return [new MeshStandardMaterial({ ...common, color: 0xd8d2c8, roughness: 0.62 })];
  return described.map((each) => {
    const [r = 1, g = 1, b = 1, a = 1] = each.base_color ?? [];
    const [er = 0, eg = 0, eb = 0] = each.emissive ?? [];
    const material = new MeshStandardMaterial({
      ...common,
      name: each.name ?? "",
      color: new Color(r, g, b),
      metalness: each.metallic ?? 0,
      roughness: each.roughness ?? 1,
      emissive: new Color(er, eg, eb),
      side: each.double_sided ? DoubleSide : FrontSide,
    });
    if (each.alpha_mode === "BLEND" && a < 1) {
      material.transparent = true;
      material.opacity = a;
      material.depthWrite = false;
    } else if (each.alpha_mode === "MASK") material.alphaTest = each.alpha_cutoff ?? 0.5;
    return material;
  });
}
