// Tints clusters on top of their material. A texture has one texel, a slot, for each resident cluster.

import { DataTexture, type Material, NearestFilter, RGBAFormat, UnsignedByteType } from "three";
import type { ClusterInfo, TintFunction } from "./cluster_info.js";
import type { ResidentGroup, ResidentGroups } from "./geometry/resident_groups.js";

const WIDTH = 1024;

export class ClusterTint {
  readonly uniform: { value: DataTexture };
  private data = new Uint8Array(4 * WIDTH);

  constructor() {
    this.uniform = { value: this.texture() };
  }

  /** Grows the texture to `slots` texels or more. */
  reserve(slots: number): void {
    let rows = this.data.length / (4 * WIDTH);
    if (slots <= rows * WIDTH) return;
    while (slots > rows * WIDTH) rows *= 2;
    const data = new Uint8Array(4 * WIDTH * rows);
    data.set(this.data);
    this.data = data;
    this.uniform.value.dispose();
    this.uniform.value = this.texture();
  }

  /** Sets a tint: sRGB from 0 to 1; `opacity` 0 leaves the material as it is, 1 covers it. */
  private set(slot: number, red: number, green: number, blue: number, opacity: number): void {
    const at = 4 * slot;
    this.data[at] = 255 * red + 0.5;
    this.data[at + 1] = 255 * green + 0.5;
    this.data[at + 2] = 255 * blue + 0.5;
    this.data[at + 3] = 255 * opacity + 0.5;
  }

  /** Sets the tints of clusters by a function. */
  paint(clusters: Iterable<ClusterInfo>, residents: ResidentGroups, tint: TintFunction): void {
    for (const info of clusters) {
      const { allocation, group } = residents.get(info.group) as ResidentGroup;
      this.set(allocation.slot + info.cluster - group.firstCluster, ...tint(info));
    }
    this.update();
  }

  clear(): void {
    this.data.fill(0);
    this.update();
  }

  private update(): void {
    this.uniform.value.needsUpdate = true;
  }

  dispose(): void {
    this.uniform.value.dispose();
  }

  /** Adds the tints to the shaders of a material. */
  applyTo(material: Material): void {
    const before = material.onBeforeCompile;
    material.onBeforeCompile = (shader, renderer) => {
      before.call(material, shader, renderer);
      shader.uniforms.umbelTint = this.uniform;
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>\n${VERTEX_DECLARATIONS}`)
        .replace("#include <begin_vertex>", `#include <begin_vertex>\n${VERTEX_CODE}`);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", "#include <common>\nflat in vec4 umbelClusterTint;")
        .replace("#include <color_fragment>", `#include <color_fragment>\n${FRAGMENT_CODE}`);
    };
  }

  private texture(): DataTexture {
    const rows = this.data.length / (4 * WIDTH);
    const texture = new DataTexture(this.data, WIDTH, rows, RGBAFormat, UnsignedByteType);
    texture.minFilter = NearestFilter;
    texture.magFilter = NearestFilter;
    texture.needsUpdate = true;
    return texture;
  }
}

const VERTEX_DECLARATIONS = `
in uint umbelSlot;
uniform sampler2D umbelTint;
flat out vec4 umbelClusterTint;`;

const VERTEX_CODE = `
umbelClusterTint = texelFetch(umbelTint, ivec2(umbelSlot % ${WIDTH}u, umbelSlot / ${WIDTH}u), 0);
umbelClusterTint.rgb = pow(umbelClusterTint.rgb, vec3(2.2));`;

const FRAGMENT_CODE = `
diffuseColor.rgb = mix(diffuseColor.rgb, umbelClusterTint.rgb, umbelClusterTint.a);`;
