import {
  MeshStandardMaterial,
  ShaderLib,
  type WebGLProgramParametersWithUniforms,
  type WebGLRenderer,
} from "three";
import { expect, test } from "vitest";
import { ClusterTint } from "../../../packages/umbel/src/three/cluster_tint.js";

/** A material with tints. */
function tinted(): MeshStandardMaterial {
  const material = new MeshStandardMaterial();
  new ClusterTint().applyTo(material);
  return material;
}

test("tinted materials share programs, but not with those that an application has changed", () => {
  const [first, second, changed] = [tinted(), tinted(), tinted()];
  const before = changed.onBeforeCompile;
  changed.onBeforeCompile = (shader, renderer) => {
    before(shader, renderer);
    shader.fragmentShader += "// changed";
  };
  expect(second.customProgramCacheKey()).toBe(first.customProgramCacheKey());
  expect(changed.customProgramCacheKey()).not.toBe(first.customProgramCacheKey());
  const { vertexShader, fragmentShader } = ShaderLib.standard;
  const shader = { vertexShader, fragmentShader, uniforms: {} };
  const parameters = shader as unknown as WebGLProgramParametersWithUniforms;
  changed.onBeforeCompile(parameters, {} as WebGLRenderer);
  expect(Object.keys(shader.uniforms)).toEqual(["umbelTint"]);
  expect(shader.vertexShader).toContain("in uint umbelSlot");
  expect(shader.fragmentShader).toMatch(/umbelClusterTint\.a.*\/\/ changed$/s);
});
