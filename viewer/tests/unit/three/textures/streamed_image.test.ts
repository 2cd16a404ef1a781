import { MeshBasicMaterial, type Texture } from "three";
import { expect, test } from "vitest";
import { StreamedImage } from "../../../../packages/umbel/src/three/textures/streamed_image.js";

const bitmap = (side: number) =>
  ({ width: side, height: side, close: () => {} }) as unknown as ImageBitmap;

test("materials share an image's memory, also those that come after it", () => {
  const image = new StreamedImage({ file: 0 });
  const sampling = { sampler: {}, info: {}, isColor: true };
  const materials = Array.from({ length: 4 }, () => new MeshBasicMaterial());
  const use = (i: number) =>
    image.use(materials[i] as MeshBasicMaterial, ["map"], {
      ...sampling,
      placeholder: {} as ImageData,
    });
  const maps = () => materials.flatMap(({ map }): Texture[] => (map ? [map] : []));
  use(0);
  use(1);
  for (const side of [64, 512]) {
    image.show(bitmap(side));
    use(side === 64 ? 2 : 3);
    expect(maps().map((map) => (map.image as ImageBitmap).width)).toEqual(maps().map(() => side));
    expect(new Set(maps().map(({ source }) => source)).size).toBe(1);
    // One texture has the image uploaded.
    expect(maps()[0]?.source.version).toBe(1);
  }
  expect(maps().length).toBe(4);
});
