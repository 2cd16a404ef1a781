// Materials of three.js for those of an asset, which are glTF's, made as they are first drawn.

import type { Material } from "three";
import { type Json, jsonOf, listOf, textOf } from "../../format/gltf.js";
import type { AssetStream } from "../../worker/asset_stream.js";
import type { Layout } from "../geometry/arena.js";
import { channelOf } from "../textures/sampler.js";
import { Textures } from "../textures/textures.js";
import { makeMaterial, plainMaterial, UNLIT } from "./material_maker.js";
import { BASE_COLOR, PHYSICAL, type Slot, STANDARD, textureInfo } from "./material_slots.js";

const GLOSSY: Slot = {
  ...BASE_COLOR,
  part: "KHR_materials_pbrSpecularGlossiness",
  name: "diffuseTexture",
};

export class Materials {
  /** All that were made. */
  readonly all: Material[] = [];
  /** What cannot be shown, a sentence each. */
  readonly notes: string[] = [];
  onNote: ((text: string) => void) | undefined;
  readonly textures: Textures;
  private readonly described: Json[];
  private readonly made = new Map<string, Material>();

  /**
   * @param basisPath the folder of the transcoder for KTX2
   * @param prepare is told of every material before it is used
   * @param onArrival is told when a texture has arrived
   */
  constructor(
    stream: AssetStream,
    basisPath: string,
    private readonly prepare: (material: Material) => void,
    onArrival: () => void,
  ) {
    this.described = listOf(stream.info.materials.materials);
    this.textures = new Textures(stream, basisPath, onArrival, (text) => this.note(text));
  }

  get names(): string[] {
    return this.described.map(({ name }) => textOf(name));
  }

  /** The material of a number, for vertices of a layout. */
  of(index: number, layout: Layout): Material {
    const key = [index, layout.normals, layout.tangents, layout.colors, layout.uvs].join();
    let material = this.made.get(key);
    if (!material) {
      const gltf = this.described[index];
      material = gltf ? this.make(index, gltf, layout) : plainMaterial(layout);
      this.prepare(material);
      this.made.set(key, material);
      this.all.push(material);
    }
    return material;
  }

  /** Says something that cannot be shown, once. */
  note(text: string): void {
    if (this.notes.includes(text)) return;
    this.notes.push(text);
    this.onNote?.(text);
  }

  dispose(): void {
    for (const material of this.all) material.dispose();
    this.textures.dispose();
  }

  private make(index: number, gltf: Json, layout: Layout): Material {
    const material = makeMaterial(gltf, layout, (text) => this.note(text));
    const isUnlit = UNLIT in jsonOf(gltf.extensions);
    for (const slot of isUnlit ? [BASE_COLOR] : [...STANDARD, ...PHYSICAL, GLOSSY]) {
      const info = textureInfo(gltf, slot);
      if (info) this.addTexture(index, material, slot, info, layout);
    }
    return material;
  }

  private addTexture(
    index: number,
    material: Material,
    { slots, isColor, neutral }: Slot,
    info: Json,
    { uvs }: Layout,
  ): void {
    const set = channelOf(info);
    if (!uvs[set]) {
      const about = set < uvs.length ? "the mesh does not have" : "cannot be shown";
      this.note(`A texture is left out: it uses texture coordinates ${set}, which ${about}.`);
    } else if (!this.textures.use(index, material, slots, info, isColor, neutral))
      this.note("A texture is left out: the asset has no image for it.");
  }
}
