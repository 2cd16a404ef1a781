// What of an asset cannot be shown here, whatever its materials are.

import { jsonOf, listOf } from "../../format/gltf.js";
import type { AssetInfo } from "../../stream/streamer.js";

export function notesOf({ meshes, scene }: AssetInfo): string[] {
  const notes: string[] = [];
  const has = (name: string) => meshes.some(({ skipped }) => skipped.includes(name));
  if (has("joints") || listOf(scene.skins).length > 0)
    notes.push("The asset has joints: it is shown as it stands, not moved.");
  if ("KHR_lights_punctual" in jsonOf(scene.extensions))
    notes.push("The asset has lamps of its own: it is shown by those of the viewer.");
  if (has("unknown")) notes.push("Vertices have attributes that are not known here.");
  return notes;
}
