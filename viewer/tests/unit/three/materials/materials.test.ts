import { expect, test, vi } from "vitest";
import { Materials } from "../../../../packages/umbel/src/three/materials/materials.js";
import type { AssetStream } from "../../../../packages/umbel/src/worker/asset_stream.js";

vi.stubGlobal("ImageData", class {});

const LAYOUT = {
  normals: true,
  tangents: false,
  uvs: [true, false, false, false],
  colors: false,
};

test("a slot shows one texture, also of materials that are described twice", () => {
  const glossiness = { diffuseTexture: { index: 1 } };
  const extensions = { KHR_materials_pbrSpecularGlossiness: glossiness };
  const pbrMetallicRoughness = { baseColorTexture: { index: 0 } };
  const stream = {
    info: {
      materials: {
        materials: [{ extensions }, { extensions, pbrMetallicRoughness }],
        textures: [{ source: 0 }, { source: 1 }],
        images: [{ file: 0 }, { file: 1 }],
      },
    },
  };
  const use = (index: number) => {
    const materials = new Materials(
      stream as unknown as AssetStream,
      "",
      () => {},
      () => {},
    );
    const used = vi.spyOn(materials.textures, "use");
    materials.of(index, LAYOUT);
    return used.mock.calls.map(([, , slots, info]) => [slots, info]);
  };
  expect(use(0)).toEqual([[["map"], { index: 1 }]]);
  expect(use(1)).toEqual([[["map"], { index: 0 }]]);
});
