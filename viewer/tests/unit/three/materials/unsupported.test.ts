import { expect, test } from "vitest";
import type { AssetInfo } from "../../../../packages/umbel/src/stream/asset_info.js";
import { unsupportedFeatures } from "../../../../packages/umbel/src/three/materials/unsupported.js";

test("lists features that are not shown", () => {
  const meshes = [{ skipped: ["joints", "texture coordinates"] }];
  const scene = { extensions: { KHR_lights_punctual: { lights: [] } } };
  const features = unsupportedFeatures({ meshes, scene } as unknown as AssetInfo);
  expect(features.map((text) => /joints|lights/.exec(text)?.[0])).toEqual(["joints", "lights"]);
  expect(
    unsupportedFeatures({ meshes: [{ skipped: [] }], scene: {} } as unknown as AssetInfo),
  ).toEqual([]);
});
