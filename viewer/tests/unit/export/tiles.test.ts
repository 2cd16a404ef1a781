// Exported tiles as loaders.gl reads them.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { Tiles3DLoader } from "@loaders.gl/3d-tiles";
import { load } from "@loaders.gl/core";
import { expect, test } from "vitest";
import { ASSETS, expectedOf } from "../../support/assets.js";

const FOLDER = join(ASSETS, "planet_tiles");

interface Tile {
  content?: { uri: string };
  boundingVolume: { box: number[] };
  lodMetricValue: number;
  children?: Tile[];
}

async function fromFolder(url: string): Promise<Response> {
  return new Response(readFileSync(join(FOLDER, new URL(url).pathname)));
}

// biome-ignore lint/suspicious/noExplicitAny: the loader's types say no more.
async function loaded(name: string, isTileset: boolean): Promise<any> {
  const options = { fetch: fromFolder, "3d-tiles": { isTileset } };
  return await load(`http://tiles/${name}`, Tiles3DLoader, options);
}

function tilesOf(tile: Tile): Tile[] {
  return [tile, ...(tile.children ?? []).flatMap(tilesOf)];
}

test("loaders.gl reads the tree, and errors fall towards the leaves", async () => {
  const { type, asset, root } = await loaded("tileset.json", true);
  expect(type).toBe("TILES3D");
  expect(asset.version).toBe("1.1");
  const tiles = tilesOf(root);
  expect(tiles.length).toBeGreaterThan(20);
  for (const tile of tiles)
    for (const child of tile.children ?? [])
      expect(child.lodMetricValue).toBeLessThan(tile.lodMetricValue);
});

test("loaders.gl decodes the tiles, and the leaves have the source's triangles", async () => {
  const { root } = await loaded("tileset.json", true);
  let atLeaves = 0;
  for (const tile of tilesOf(root)) {
    const uri = tile.content?.uri;
    if (!uri) continue;
    const content = await loaded(uri, false);
    expect(content.type).toBe("glTF");
    const [{ primitives }] = content.gltf.meshes;
    let triangles = 0;
    for (const { attributes, indices } of primitives) {
      const corners = indices.value;
      triangles += corners.length / 3;
      expect(Math.max(...corners)).toBeLessThan(attributes.POSITION.count);
    }
    expect(triangles).toBeGreaterThan(0);
    if (!tile.children?.length) atLeaves += triangles;
  }
  // Those that planes between cells cut are several.
  const { source_triangles: source } = expectedOf("planet");
  expect(atLeaves).toBeGreaterThanOrEqual(source);
  expect(atLeaves).toBeLessThan(1.2 * source);
});
