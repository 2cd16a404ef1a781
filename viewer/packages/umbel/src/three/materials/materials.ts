// The materials of an asset, converted from glTF when they are first drawn.

import type { Material, Side } from "three";
import { type Json, jsonOf, listOf, textOf } from "../../format/gltf.js";
import type { AssetStream } from "../../worker/asset_stream.js";
import type { VertexLayout } from "../geometry/arena.js";
import { channelOf } from "../textures/sampler.js";
import { Textures } from "../textures/textures.js";
import { glossinessOf, makeMaterial, plainMaterial, sideOf, UNLIT } from "./material_maker.js";
import { BASE_COLOR, PHYSICAL, type Slot, STANDARD, textureInfo } from "./material_slots.js";

const GLOSSY: Slot = {
  ...BASE_COLOR,
  part: "KHR_materials_pbrSpecularGlossiness",
  name: "diffuseTexture",
};

export class Materials {
  /** All materials so far. */
  readonly all: Material[] = [];
  /** Sentences about what is not shown. */
  readonly notes: string[] = [];
  /** Called with each new sentence, and with one that no longer holds. */
  onNote: ((text: string, holds: boolean) => void) | undefined;
  readonly textures: Textures;
  /** glTF's materials. */
  private readonly definitions: Json[];
  /** By the index of the material and the layout of its vertices. */
  private readonly made = new Map<string, Material>();

  /**
   * @param basisPath folder of the transcoder for KTX2
   * @param prepare is called with every material before its first use
   * @param onArrival is called when a texture has arrived
   */
  constructor(
    stream: AssetStream,
    basisPath: string,
    private readonly prepare: (material: Material) => void,
    onArrival: () => void,
  ) {
    this.definitions = listOf(stream.info.materials.materials);
    this.textures = new Textures(stream, basisPath, onArrival, (text, holds) =>
      this.note(text, holds),
    );
  }

  get names(): string[] {
    return this.definitions.map(({ name }) => textOf(name));
  }

  /** The material of an index, for vertices of a layout. */
  of(index: number, layout: VertexLayout): Material {
    const key = keyOf(index, layout);
    let material = this.made.get(key);
    if (!material) {
      const gltf = this.definitions[index];
      material = gltf ? this.make(index, gltf, layout) : plainMaterial(layout);
      this.prepare(material);
      this.made.set(key, material);
      this.all.push(material);
    }
    return material;
  }

  /** Which sides of triangles that material shows, whether it has been made or not. */
  sideOf(index: number, layout: VertexLayout): Side {
    return this.made.get(keyOf(index, layout))?.side ?? sideOf(this.definitions[index] ?? {});
  }

  /** Reports something that is not shown, once; or that it `holds` no longer. */
  note(text: string, holds = true): void {
    const at = this.notes.indexOf(text);
    if (at >= 0 === holds) return;
    if (holds) this.notes.push(text);
    else this.notes.splice(at, 1);
    this.onNote?.(text, holds);
  }

  dispose(): void {
    for (const material of this.all) material.dispose();
    this.textures.dispose();
  }

  private make(index: number, gltf: Json, layout: VertexLayout): Material {
    const material = makeMaterial(gltf, layout, (text) => this.note(text));
    const isUnlit = UNLIT in jsonOf(gltf.extensions);
    const base = glossinessOf(gltf) ? [GLOSSY] : [];
    for (const slot of isUnlit ? [BASE_COLOR] : [...STANDARD, ...PHYSICAL, ...base]) {
      const info = textureInfo(gltf, slot);
      if (info) this.addTexture(index, material, slot, info, layout);
    }
    return material;
  }

  private addTexture(
    index: number,
    material: Material,
    { slots, isColor, placeholder }: Slot,
    info: Json,
    { uvs }: VertexLayout,
  ): void {
    const set = channelOf(info);
    if (!uvs[set]) {
      const reason = set < uvs.length ? "the mesh does not have" : "this viewer does not support";
      this.note(`A texture is not shown: it uses texture coordinates ${set}, which ${reason}.`);
    } else if (!this.textures.use(index, material, slots, info, isColor, placeholder))
      this.note("A texture is not shown: the asset has no image for it.");
  }
}

function keyOf(index: number, { normals, tangents, colors, uvs }: VertexLayout): string {
  return [index, normals, tangents, colors, uvs].join();
}
