// Lists the features of an asset that are not shown, those of materials excluded.

import { jsonOf, listOf } from "../../format/gltf.js";
import type { AssetInfo } from "../../stream/asset_info.js";

export function unsupportedFeatures({ meshes, scene }: AssetInfo): string[] {
  const notes: string[] = [];
  const has = (name: string) => meshes.some(({ skipped }) => skipped.includes(name));
  if (has("joints") || listOf(scene.skins).length > 0)
    notes.push("The asset has joints: it is shown in its rest pose.");
  if ("KHR_lights_punctual" in jsonOf(scene.extensions))
    notes.push("The asset has lights: it is shown by those of the viewer.");
  if (has("unknown")) notes.push("Vertices have attributes that this viewer does not know.");
  return notes;
}
