// Colours that clusters have on top of their material: a texture with one texel for each cluster
// that is in memory.

import { DataTexture, type Material, NearestFilter, RGBAFormat, UnsignedByteType } from "three";

const WIDTH = 1024;

export class Tint {
  readonly uniform: { value: DataTexture };
  private data = new Uint8Array(4 * WIDTH);

  constructor() {
    this.uniform = { value: this.texture() };
  }

  /** Sees that there are texels up to `slots`. */
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

  /** sRGB from 0 to 1; `amount` 0 leaves the material as it is, 1 covers it. */
  set(slot: number, red: number, green: number, blue: number, amount: number): void {
    const at = 4 * slot;
    this.data[at] = 255 * red + 0.5;
    this.data[at + 1] = 255 * green + 0.5;
    this.data[at + 2] = 255 * blue + 0.5;
    this.data[at + 3] = 255 * amount + 0.5;
  }

  clear(): void {
    this.data.fill(0);
    this.update();
  }

  update(): void {
    this.uniform.value.needsUpdate = true;
  }

  dispose(): void {
    this.uniform.value.dispose();
  }

  /** Makes a material of three.js show the tints. */
  applyTo(material: Material): void {
    const before = material.onBeforeCompile;
    material.onBeforeCompile = (shader, renderer) => {
      before.call(material, shader, renderer);
      shader.uniforms.umbelTint = this.uniform;
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>\n${VERTEX_DECLARATIONS}`)
        .replace("#include <begin_vertex>", `#include <begin_vertex>\n${VERTEX_CODE}`);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", "#include <common>\nflat in vec4 umbelTintHere;")
        .replace("#include <color_fragment>", `#include <color_fragment>\n${FRAGMENT_CODE}`);
    };
    material.customProgramCacheKey = () => "umbel tint";
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
flat out vec4 umbelTintHere;`;

const VERTEX_CODE = `
umbelTintHere = texelFetch(umbelTint, ivec2(umbelSlot % ${WIDTH}u, umbelSlot / ${WIDTH}u), 0);
umbelTintHere.rgb = pow(umbelTintHere.rgb, vec3(2.2));`;

const FRAGMENT_CODE = `
diffuseColor.rgb = mix(diffuseColor.rgb, umbelTintHere.rgb, umbelTintHere.a);`;
