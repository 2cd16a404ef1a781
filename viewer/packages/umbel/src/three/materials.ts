// Materials of three.js for those of an asset, which are glTF's.

import {
  ClampToEdgeWrapping,
  Color,
  DoubleSide,
  FrontSide,
  type Material,
  MeshBasicMaterial,
  MeshStandardMaterial,
  MirroredRepeatWrapping,
  RepeatWrapping,
  SRGBColorSpace,
  Texture,
  Vector2,
} from "three";
import type { AssetStream } from "../stream.js";
import type { Layout } from "./arena.js";

/** The parts of glTF that are read here. */
interface TextureInfo {
  index?: number;
  texCoord?: number;
  scale?: number;
  strength?: number;
  extensions?: {
    KHR_texture_transform?: { offset?: number[]; scale?: number[]; rotation?: number };
  };
}

interface GltfMaterial {
  name?: string;
  pbrMetallicRoughness?: {
    baseColorFactor?: number[];
    metallicFactor?: number;
    roughnessFactor?: number;
    baseColorTexture?: TextureInfo;
    metallicRoughnessTexture?: TextureInfo;
  };
  normalTexture?: TextureInfo;
  occlusionTexture?: TextureInfo;
  emissiveTexture?: TextureInfo;
  emissiveFactor?: number[];
  alphaMode?: string;
  alphaCutoff?: number;
  doubleSided?: boolean;
  extensions?: Record<string, unknown>;
}

interface Gltf {
  materials?: GltfMaterial[];
  textures?: {
    source?: number;
    sampler?: number;
    extensions?: Record<string, { source?: number }>;
  }[];
  samplers?: { wrapS?: number; wrapT?: number }[];
  images?: { uri?: string; file?: number; mimeType?: string }[];
}

type Slot = "map" | "metalnessMap" | "roughnessMap" | "normalMap" | "aoMap" | "emissiveMap";

const WRAPS = new Map([
  [33071, ClampToEdgeWrapping],
  [33648, MirroredRepeatWrapping],
]);

function listOf<T>(value: unknown): T[] {
  return Array.isArray(value) ? (value as T[]) : [];
}

export class Materials {
  /** All that were made. */
  readonly all: Material[] = [];
  private readonly gltf: Required<Gltf>;
  private readonly made = new Map<string, Material>();
  private readonly images = new Map<number, Promise<ImageBitmap | undefined>>();
  private readonly textures: Texture[] = [];

  /**
   * @param prepare is told of every material before it is used
   * @param onArrival is told when a texture has arrived
   */
  constructor(
    private readonly stream: AssetStream,
    private readonly prepare: (material: Material) => void,
    private readonly onArrival: () => void,
  ) {
    const { materials, textures, samplers, images } = stream.info.materials as Gltf;
    this.gltf = {
      materials: listOf(materials),
      textures: listOf(textures),
      samplers: listOf(samplers),
      images: listOf(images),
    };
  }

  get names(): string[] {
    return this.gltf.materials.map(({ name }) => name ?? "");
  }

  /** The material of a number, for vertices of a layout. */
  of(index: number, layout: Layout): Material {
    const key = `${index} ${layout.normals} ${layout.colors} ${layout.uvs}`;
    let material = this.made.get(key);
    if (!material) {
      const common = { flatShading: !layout.normals, vertexColors: layout.colors };
      const described = this.gltf.materials[index];
      material = described
        ? this.make(described, common, layout)
        : new MeshStandardMaterial({ ...common, color: 0xd8d2c8, roughness: 0.62 });
      this.prepare(material);
      this.made.set(key, material);
      this.all.push(material);
    }
    return material;
  }

  dispose(): void {
    for (const material of this.all) material.dispose();
    for (const texture of this.textures) texture.dispose();
  }

  private make(
    gltf: GltfMaterial,
    common: { flatShading: boolean; vertexColors: boolean },
    layout: Layout,
  ): Material {
    const pbr = gltf.pbrMetallicRoughness ?? {};
    const [r = 1, g = 1, b = 1, a = 1] = pbr.baseColorFactor ?? [];
    // What is said to be blended but lets nothing through is drawn as what is solid.
    const isBlended = gltf.alphaMode === "BLEND" && (a < 1 || pbr.baseColorTexture !== undefined);
    const shared = {
      name: gltf.name ?? "",
      color: new Color(r, g, b),
      side: gltf.doubleSided ? DoubleSide : FrontSide,
      transparent: isBlended,
      depthWrite: !isBlended,
      opacity: isBlended ? a : 1,
      alphaTest: gltf.alphaMode === "MASK" ? (gltf.alphaCutoff ?? 0.5) : 0,
    };
    if (gltf.extensions && "KHR_materials_unlit" in gltf.extensions) {
      const material = new MeshBasicMaterial({ ...shared, vertexColors: common.vertexColors });
      if (layout.uvs) this.load(material, ["map"], pbr.baseColorTexture, true);
      return material;
    }
    const [er = 0, eg = 0, eb = 0] = gltf.emissiveFactor ?? [];
    const material = new MeshStandardMaterial({
      ...common,
      ...shared,
      metalness: pbr.metallicFactor ?? 1,
      roughness: pbr.roughnessFactor ?? 1,
      emissive: new Color(er, eg, eb),
      normalScale: new Vector2().setScalar(gltf.normalTexture?.scale ?? 1),
      aoMapIntensity: gltf.occlusionTexture?.strength ?? 1,
    });
    if (!layout.uvs) return material;
    this.load(material, ["map"], pbr.baseColorTexture, true);
    this.load(material, ["metalnessMap", "roughnessMap"], pbr.metallicRoughnessTexture, false);
    this.load(material, ["normalMap"], gltf.normalTexture, false);
    this.load(material, ["aoMap"], gltf.occlusionTexture, false);
    this.load(material, ["emissiveMap"], gltf.emissiveTexture, true);
    return material;
  }

  /** Puts a texture into a material once it has arrived; without it the material stays plain. */
  private async load(
    material: Material,
    slots: readonly Slot[],
    info: TextureInfo | undefined,
    isColor: boolean,
  ): Promise<void> {
    // Assets have one set of texture coordinates here.
    if (info?.index === undefined || (info.texCoord ?? 0) !== 0) return;
    const gltf = this.gltf.textures[info.index];
    const source = gltf?.extensions?.EXT_texture_webp?.source ?? gltf?.source;
    const image = source === undefined ? undefined : await this.image(source);
    if (!image) return;
    const texture = new Texture(image);
    const sampler = this.gltf.samplers[gltf?.sampler ?? -1];
    texture.wrapS = WRAPS.get(sampler?.wrapS ?? 0) ?? RepeatWrapping;
    texture.wrapT = WRAPS.get(sampler?.wrapT ?? 0) ?? RepeatWrapping;
    texture.flipY = false;
    texture.anisotropy = 4;
    if (isColor) texture.colorSpace = SRGBColorSpace;
    const transform = info.extensions?.KHR_texture_transform;
    if (transform) {
      texture.offset.fromArray(transform.offset ?? [0, 0]);
      texture.repeat.fromArray(transform.scale ?? [1, 1]);
      texture.rotation = transform.rotation ?? 0;
    }
    texture.needsUpdate = true;
    this.textures.push(texture);
    for (const slot of slots) (material as unknown as Record<Slot, Texture>)[slot] = texture;
    material.needsUpdate = true;
    this.onArrival();
  }

  private image(index: number): Promise<ImageBitmap | undefined> {
    let image = this.images.get(index);
    if (!image) {
      image = this.fetchImage(index).catch(() => undefined);
      this.images.set(index, image);
    }
    return image;
  }

  private async fetchImage(index: number): Promise<ImageBitmap | undefined> {
    const { file, uri, mimeType } = this.gltf.images[index] ?? {};
    let blob: Blob;
    if (file !== undefined) {
      const bytes = await this.stream.readFile(file);
      if (!bytes) return undefined;
      blob = new Blob([bytes as Uint8Array<ArrayBuffer>], { type: mimeType ?? "" });
    } else if (uri !== undefined && this.stream.address !== undefined) {
      const answer = await fetch(new URL(uri, this.stream.address));
      if (!answer.ok) return undefined;
      blob = await answer.blob();
    } else return undefined;
    return createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  }
}
