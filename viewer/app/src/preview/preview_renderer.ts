// Draws the first picture while the viewer and three.js still load: the groups that have arrived,
// without textures, by WebGL 2 alone.

import {
  type AssetInfo,
  type AssetStream,
  boundsOf,
  cameraView,
  jsonOf,
  listOf,
  type MeshView,
  numbersOf,
  type RenderGroup,
  type StreamUpdate,
} from "umbel";
import { type CameraPose, MAX_PIXEL_RATIO } from "../state";
import {
  boundingSphereOf,
  depthsOf,
  FIELD_OF_VIEW,
  homePose,
  sceneUnit,
  translated,
  UNTEXTURED_ERROR_FACTOR,
} from "../viewport/camera";
import {
  fromRows,
  type Matrix,
  multiply,
  originOf,
  perspective,
  scalesOf,
  sidePlanesOf,
  viewMatrix,
} from "./matrix";
import { useProgram } from "./shaders";

/** Linear colour of meshes without a material. */
const PLAIN = [0.6867, 0.6445, 0.5776];
/** Factor on the allowed error outside of the view volume, as in UmbelMesh. */
const OFFSCREEN = 4;
const FOV = (FIELD_OF_VIEW * Math.PI) / 180;

interface UploadedGroup {
  group: RenderGroup;
  vertices: WebGLVertexArrayObject;
}

export class PreviewRenderer {
  /** Resolves once triangles are on the screen. */
  readonly isShown: Promise<void>;
  private resolveShown = () => {};
  private readonly element = document.createElement("div");
  private readonly gl: WebGL2RenderingContext;
  private readonly program: WebGLProgram;
  private readonly groups = new Map<number, UploadedGroup>();
  /** The base colour of each material. */
  private readonly colors: number[][];
  /** For each instance, from the mesh to the camera. */
  private readonly modelViews: Matrix[];
  private cuts: Uint32Array[] = [];

  constructor(
    root: HTMLElement,
    private readonly stream: AssetStream,
    pose: CameraPose | undefined,
    pixelError: number,
  ) {
    this.isShown = new Promise((resolve) => {
      this.resolveShown = resolve;
    });
    const canvas = document.createElement("canvas");
    this.element.className = "viewport";
    this.element.append(canvas);
    root.append(this.element);
    const ratio = Math.min(devicePixelRatio, MAX_PIXEL_RATIO);
    canvas.width = Math.floor(this.element.clientWidth * ratio);
    canvas.height = Math.floor(this.element.clientHeight * ratio);
    this.gl = canvas.getContext("webgl2") as WebGL2RenderingContext;
    this.program = useProgram(this.gl);
    this.gl.enable(this.gl.DEPTH_TEST);
    // The colour of vertices without one.
    this.gl.vertexAttrib3f(2, 1, 1, 1);
    this.colors = baseColorsOf(stream.info);
    const hasImages = listOf(stream.info.materials.images).length > 0;
    const factor = hasImages ? UNTEXTURED_ERROR_FACTOR : 1;
    this.modelViews = this.setUpCamera(pose, factor * pixelError);
    stream.onPreviewUpdate = (update) => this.apply(update);
  }

  dispose(): void {
    this.stream.onPreviewUpdate = undefined;
    this.element.remove();
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  /** Sets the camera, sends its views to the stream, and returns the matrix of each instance. */
  private setUpCamera(pose: CameraPose | undefined, pixelError: number): Matrix[] {
    const { gl, stream } = this;
    const { width, height } = gl.canvas;
    const sphere = boundingSphereOf(stream.info);
    const { position, target } = pose
      ? translated(pose, stream.info.origin, -1)
      : homePose(boundsOf(stream.info), width / height);
    const distance = Math.hypot(...position.map((x, i) => x - (sphere.center[i] as number)));
    const unit = sceneUnit(stream.info);
    const { near, far } = depthsOf(unit * distance, unit * sphere.radius);
    const projection = perspective(FOV, width / height, near, far);
    const view = viewMatrix(position, target);
    gl.uniformMatrix4fv(this.uniform("projection"), false, projection);
    gl.uniform3fv(this.uniform("up"), view.slice(4, 7));
    const modelViews = stream.info.instances.map(({ matrix }) => multiply(view, fromRows(matrix)));
    stream.setViews(
      modelViews.map((modelView, i): MeshView => {
        const scales = scalesOf(modelView);
        const pixels = (pixelError * Math.min(...scales)) / Math.max(...scales);
        const planes = sidePlanesOf(multiply(projection, modelView));
        const camera = cameraView(originOf(modelView), FOV, height, pixels);
        const { mesh } = stream.info.instances[i] as { mesh: number };
        return { mesh, view: { ...camera, planes, offscreen: OFFSCREEN } };
      }),
    );
    return modelViews.map((matrix) => matrix.map((x, i) => (i % 4 < 3 ? unit * x : x)));
  }

  private uniform(name: string): WebGLUniformLocation | null {
    return this.gl.getUniformLocation(this.program, name);
  }

  private apply({ added, removed, cuts, statistics }: StreamUpdate): void {
    for (const group of removed) this.groups.delete(group);
    for (const group of added) this.groups.set(group.group, this.upload(group));
    if (!cuts) return;
    this.cuts = cuts;
    if (this.draw() === 0) return;
    requestAnimationFrame(() => {
      performance.mark("umbel-first-picture", { detail: statistics });
      this.resolveShown();
    });
  }

  private upload(group: RenderGroup): UploadedGroup {
    const { gl } = this;
    const vertices = gl.createVertexArray() as WebGLVertexArrayObject;
    gl.bindVertexArray(vertices);
    const attribute = (
      location: number,
      values: ArrayBufferView | undefined,
      type: number,
      size: number,
    ) => {
      if (!values) return;
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, type, type !== gl.FLOAT, 0, 0);
    };
    attribute(0, group.positions, gl.FLOAT, 3);
    attribute(1, group.normals, gl.SHORT, 4);
    attribute(2, group.colors, gl.UNSIGNED_SHORT, 4);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, group.indices, gl.STATIC_DRAW);
    // A copy: the stream's listener empties the group later.
    return { group: { ...group }, vertices };
  }

  /** Draws the cuts; returns the number of runs of clusters in them. */
  private draw(): number {
    const { gl, groups } = this;
    const groupOf = new Map<number, UploadedGroup>();
    for (const each of groups.values())
      for (let i = 0; i < each.group.clusterCount; ++i)
        groupOf.set(each.group.firstCluster + i, each);
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    let runs = 0;
    this.cuts.forEach((cut, i) => {
      gl.uniformMatrix4fv(this.uniform("toView"), false, this.modelViews[i] as Matrix);
      for (let run = 0; run < cut.length; run += 3, ++runs) {
        const found = groupOf.get(cut[run] as number);
        if (found) this.drawRun(found, cut[run] as number, cut[run + 1] as number);
      }
    });
    return runs;
  }

  private drawRun({ group, vertices }: UploadedGroup, first: number, count: number): void {
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

function baseColorsOf({ materials }: AssetInfo): number[][] {
  return listOf(materials.materials).map(({ pbrMetallicRoughness }) =>
    numbersOf(jsonOf(pbrMetallicRoughness).baseColorFactor, [1, 1, 1]),
  );
}
