// The first picture, while the rest of the page is still on its way: what has arrived of the asset,
// without textures, drawn by WebGL 2 alone.

import {
  type AssetInfo,
  type AssetStream,
  cameraView,
  jsonOf,
  listOf,
  type MeshView,
  numbersOf,
  type RenderGroup,
  type StreamUpdate,
} from "umbel";
import { type CameraPose, MAX_PIXEL_RATIO } from "../state";
import { ballOf, depthsOf, FIELD_OF_VIEW, homePose, movedBy, UNDRESSED } from "../viewport/camera";
import { FILL, KEY, type Lamp, linear, SKY } from "../viewport/lights";
import {
  fromRows,
  type Matrix,
  multiply,
  originOf,
  perspective,
  scalesOf,
  sidesOf,
  viewMatrix,
} from "./matrix";

/** What has no material. */
const PLAIN = [0.6867, 0.6445, 0.5776];
/** As in `UmbelMesh`: how much coarser it may be outside the picture. */
const OFFSCREEN = 4;
const FOV = (FIELD_OF_VIEW * Math.PI) / 180;

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 color;
uniform mat4 toView, projection;
out vec3 place, facing, tint;
void main() {
  vec4 p = toView * vec4(position, 1);
  place = p.xyz;
  facing = mat3(toView) * normal;
  tint = color;
  gl_Position = projection * p;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 place, facing, tint;
uniform vec3 base, up;
uniform bool isSmooth;
out vec4 pixel;
void main() {
  vec3 n = normalize(isSmooth ? facing : cross(dFdx(place), dFdy(place)));
  vec3 light = ${lamp(KEY)} + ${lamp(FILL)}
    + mix(${rgb(SKY.ground, SKY.intensity)}, ${rgb(SKY.color, SKY.intensity)}, .5 + .5 * dot(n, up));
  vec3 c = base * tint * light / 3.14159265;
  pixel = vec4(mix(12.92 * c, 1.055 * pow(c, vec3(1. / 2.4)) - .055, step(.0031308, c)), 1);
}`;

function vec3(numbers: readonly number[]): string {
  return `vec3(${numbers.map((x) => x.toFixed(6)).join(", ")})`;
}

function rgb(color: number, intensity: number): string {
  return vec3(linear(color, intensity));
}

function lamp({ color, intensity, from }: Lamp): string {
  const length = Math.hypot(...from);
  return `${rgb(color, intensity)} * max(dot(n, ${vec3(from.map((x) => x / length))}), 0.)`;
}

interface OnGpu {
  group: RenderGroup;
  vertices: WebGLVertexArrayObject;
}

export class Sketch {
  /** Fulfilled once triangles are on the screen. */
  readonly isSeen: Promise<void>;
  private tellSeen = () => {};
  private readonly element = document.createElement("div");
  private readonly gl: WebGL2RenderingContext;
  private readonly program: WebGLProgram;
  private readonly groups = new Map<number, OnGpu>();
  private readonly colors: number[][];
  private readonly places: Matrix[];
  private cuts: Uint32Array[] = [];

  constructor(
    root: HTMLElement,
    private readonly stream: AssetStream,
    pose: CameraPose | undefined,
    pixelError: number,
  ) {
    this.isSeen = new Promise((resolve) => {
      this.tellSeen = resolve;
    });
    const canvas = document.createElement("canvas");
    this.element.className = "stage";
    this.element.append(canvas);
    root.append(this.element);
    const ratio = Math.min(devicePixelRatio, MAX_PIXEL_RATIO);
    canvas.width = Math.floor(this.element.clientWidth * ratio);
    canvas.height = Math.floor(this.element.clientHeight * ratio);
    this.gl = canvas.getContext("webgl2") as WebGL2RenderingContext;
    this.program = this.makeProgram();
    this.colors = colorsOf(stream.info);
    const hasImages = listOf(stream.info.materials.images).length > 0;
    this.places = this.look(pose, (hasImages ? UNDRESSED : 1) * pixelError);
    stream.preview = (update) => this.take(update);
  }

  dispose(): void {
    this.stream.preview = undefined;
    this.element.remove();
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  /** Sets up the camera, asks for what it sees, and gives the matrix from each instance to it. */
  private look(pose: CameraPose | undefined, pixelError: number): Matrix[] {
    const { gl, stream } = this;
    const { width, height } = gl.canvas;
    const ball = ballOf(stream.info);
    const { position, target } = pose
      ? movedBy(pose, stream.info.origin, -1)
      : homePose(stream.info, width / height);
    const distance = Math.hypot(...position.map((x, i) => x - (ball.center[i] as number)));
    const { near, far } = depthsOf(distance, ball.radius);
    const projection = perspective(FOV, width / height, near, far);
    const view = viewMatrix(position, target);
    gl.uniformMatrix4fv(this.uniform("projection"), false, projection);
    gl.uniform3fv(this.uniform("up"), view.slice(4, 7));
    const places = stream.info.instances.map(({ matrix }) => multiply(view, fromRows(matrix)));
    stream.setViews(
      places.map((place, i): MeshView => {
        const scales = scalesOf(place);
        const pixels = (pixelError * Math.min(...scales)) / Math.max(...scales);
        const planes = sidesOf(multiply(projection, place));
        const seen = cameraView(originOf(place), FOV, height, pixels);
        const { mesh } = stream.info.instances[i] as { mesh: number };
        return { mesh, view: { ...seen, planes, offscreen: OFFSCREEN } };
      }),
    );
    return places;
  }

  private makeProgram(): WebGLProgram {
    const { gl } = this;
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
    gl.enable(gl.DEPTH_TEST);
    gl.vertexAttrib3f(2, 1, 1, 1);
    return program;
  }

  private uniform(name: string): WebGLUniformLocation | null {
    return this.gl.getUniformLocation(this.program, name);
  }

  private take({ added, removed, cuts, statistics }: StreamUpdate): void {
    for (const group of removed) this.groups.delete(group);
    for (const group of added) this.groups.set(group.group, this.upload(group));
    if (!cuts) return;
    this.cuts = cuts;
    if (this.draw() === 0) return;
    requestAnimationFrame(() => {
      performance.mark("umbel-first-picture", { detail: statistics });
      this.tellSeen();
    });
  }

  private upload(group: RenderGroup): OnGpu {
    const { gl } = this;
    const vertices = gl.createVertexArray() as WebGLVertexArrayObject;
    gl.bindVertexArray(vertices);
    const attribute = (
      place: number,
      values: ArrayBufferView | undefined,
      type: number,
      size: number,
    ) => {
      if (!values) return;
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, type !== gl.FLOAT, 0, 0);
    };
    attribute(0, group.positions, gl.FLOAT, 3);
    attribute(1, group.normals, gl.SHORT, 4);
    attribute(2, group.colors, gl.UNSIGNED_SHORT, 4);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, group.indices, gl.STATIC_DRAW);
    // The stream's next listener takes the arrays away.
    return { group: { ...group }, vertices };
  }

  /** Draws the cut as it is; the number of runs of clusters in it. */
  private draw(): number {
    const { gl, groups } = this;
    const groupOf = new Map<number, OnGpu>();
    for (const each of groups.values())
      for (let i = 0; i < each.group.clusterCount; ++i)
        groupOf.set(each.group.firstCluster + i, each);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    let runs = 0;
    this.cuts.forEach((cut, i) => {
      gl.uniformMatrix4fv(this.uniform("toView"), false, this.places[i] as Matrix);
      for (let run = 0; run < cut.length; run += 3, ++runs) {
        const found = groupOf.get(cut[run] as number);
        if (found) this.drawRun(found, cut[run] as number, cut[run + 1] as number);
      }
    });
    return runs;
  }

  private drawRun({ group, vertices }: OnGpu, first: number, count: number): void {
    const { gl } = this;
    gl.bindVertexArray(vertices);
    gl.uniform1i(this.uniform("isSmooth"), group.normals ? 1 : 0);
    const begin = first - group.firstCluster;
    for (let c = begin; c < begin + count; ++c) {
      const from = group.triangleOffsets[c] as number;
      const triangles = (group.triangleOffsets[c + 1] as number) - from;
      gl.uniform3fv(this.uniform("base"), this.colors[group.material[c] as number] ?? PLAIN);
      gl.drawElements(gl.TRIANGLES, 3 * triangles, gl.UNSIGNED_INT, 12 * from);
    }
  }
}

/** The plain colours of glTF's materials. */
function colorsOf({ materials }: AssetInfo): number[][] {
  return listOf(materials.materials).map(({ pbrMetallicRoughness }) =>
    numbersOf(jsonOf(pbrMetallicRoughness).baseColorFactor, [1, 1, 1]),
  );
}
