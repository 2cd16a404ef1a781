// The shaders of the preview, with the lights of the viewer as constants.

import { FILL_LIGHT, KEY_LIGHT, type LightSetup, linear, SKY_LIGHT } from "../viewport/lights";

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 color;
uniform mat4 toView, projection;
out vec3 viewPosition, viewNormal, tint;
void main() {
  vec4 p = toView * vec4(position, 1);
  viewPosition = p.xyz;
  viewNormal = mat3(toView) * normal;
  tint = color;
  gl_Position = projection * p;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 viewPosition, viewNormal, tint;
uniform vec3 base, up;
uniform bool isSmooth;
out vec4 pixel;
void main() {
  vec3 n = normalize(isSmooth ? viewNormal : cross(dFdx(viewPosition), dFdy(viewPosition)));
  vec3 light = ${lambert(KEY_LIGHT)} + ${lambert(FILL_LIGHT)}
    + mix(${rgb(SKY_LIGHT.ground, SKY_LIGHT.intensity)}, ${rgb(SKY_LIGHT.color, SKY_LIGHT.intensity)}, .5 + .5 * dot(n, up));
  vec3 c = base * tint * light / 3.14159265;
  pixel = vec4(mix(12.92 * c, 1.055 * pow(c, vec3(1. / 2.4)) - .055, step(.0031308, c)), 1);
}`;

function vec3(numbers: readonly number[]): string {
  return `vec3(${numbers.map((x) => x.toFixed(6)).join(", ")})`;
}

function rgb(color: number, intensity: number): string {
  return vec3(linear(color, intensity));
}

function lambert({ color, intensity, from }: LightSetup): string {
  const length = Math.hypot(...from);
  return `${rgb(color, intensity)} * max(dot(n, ${vec3(from.map((x) => x / length))}), 0.)`;
}

/** Compiles the program and makes it current. */
export function useProgram(gl: WebGL2RenderingContext): WebGLProgram {
  const program = gl.createProgram() as WebGLProgram;
  for (const [type, source] of [
    [gl.VERTEX_SHADER, VERTEX],
    [gl.FRAGMENT_SHADER, FRAGMENT],
  ] as const) {
    const shader = gl.createShader(type) as WebGLShader;
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  return program;
}
