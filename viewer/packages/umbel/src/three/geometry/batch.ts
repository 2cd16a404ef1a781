// Draws many ranges of one geometry in one call, with any material.
//
// The object's own draw range is empty: three.js binds the program, the buffers and the state, and
// draws nothing. The ranges are drawn right after, while those are bound.

import {
  type Box3,
  type BufferAttribute,
  type BufferGeometry,
  type InstancedBufferAttribute,
  LineSegments,
  type Material,
  Mesh,
  type MeshBasicMaterial,
  type Object3D,
  Sphere,
  type Vector3,
  type WebGLRenderer,
} from "three";

interface MultiDraw {
  multiDrawElementsWEBGL(
    mode: number,
    counts: Int32Array,
    countsAt: number,
    type: number,
    offsets: Int32Array,
    offsetsAt: number,
    draws: number,
  ): void;
}

type Mode = "TRIANGLES" | "LINES";
type IndexType = "UNSIGNED_INT" | "UNSIGNED_SHORT";

/** Ranges of indices, in the form of WEBGL_multi_draw. */
export class Ranges {
  counts = new Int32Array(256);
  offsets = new Int32Array(256);
  length = 0;

  clear(): void {
    this.length = 0;
  }

  /** Adds a range of indices of so many bytes; merges it with the last where it continues that. */
  add(start: number, count: number, bytes = 4): void {
    const last = this.length - 1;
    if (last >= 0 && this.offsets[last] + bytes * this.counts[last] === bytes * start) {
      this.counts[last] += count;
      return;
    }
    if (this.length === this.counts.length) this.grow();
    this.offsets[this.length] = bytes * start;
    this.counts[this.length++] = count;
  }

  private grow(): void {
    const { counts, offsets } = this;
    this.counts = new Int32Array(2 * counts.length);
    this.offsets = new Int32Array(2 * offsets.length);
    this.counts.set(counts);
    this.offsets.set(offsets);
  }

  /**
   * @param type of the indices that are bound
   * @param instances number of instances; undefined without instancing
   */
  draw(renderer: WebGLRenderer, mode: Mode, type: IndexType, instances?: number): void {
    if (this.length === 0) return;
    const gl = renderer.getContext() as WebGL2RenderingContext;
    const multi = renderer.extensions.get("WEBGL_multi_draw") as MultiDraw | null;
    const { counts, offsets, length } = this;
    if (instances !== undefined)
      for (let i = 0; i < length; ++i)
        gl.drawElementsInstanced(gl[mode], counts[i], gl[type], offsets[i], instances);
    else if (multi) multi.multiDrawElementsWEBGL(gl[mode], counts, 0, gl[type], offsets, 0, length);
    else
      for (let i = 0; i < length; ++i) gl.drawElements(gl[mode], counts[i], gl[type], offsets[i]);
  }

  /** The same triangles as three lines each, two indices a line, of so many bytes. */
  asLines(bytes: number): Ranges {
    const lines = new Ranges();
    for (let i = 0; i < this.length; ++i)
      lines.add(2 * (this.offsets[i] / 4), 2 * this.counts[i], bytes);
    return lines;
  }
}

/** Draws the ranges of an object, after three.js has bound what a material needs. */
function draw(
  { instances }: Drawn,
  ranges: Ranges,
  mode: Mode,
  renderer: WebGLRenderer,
  geometry: BufferGeometry,
  material: Material,
): void {
  const count = instances?.count;
  if (!(material as MeshBasicMaterial).wireframe)
    ranges.draw(renderer, mode, "UNSIGNED_INT", count);
  else if (mode === "TRIANGLES") {
    // three.js has bound lines in place of the triangles, with two or four bytes an index.
    const gl = renderer.getContext();
    const bytes = gl.getBufferParameter(gl.ELEMENT_ARRAY_BUFFER, gl.BUFFER_SIZE) as number;
    const isShort = bytes < 8 * (geometry.index as BufferAttribute).count;
    const lines = ranges.asLines(isShort ? 2 : 4);
    lines.draw(renderer, "LINES", isShort ? "UNSIGNED_SHORT" : "UNSIGNED_INT", count);
  }
}

function setUp(object: Drawn, ranges: Ranges, mode: Mode): void {
  object.frustumCulled = false;
  object.matrixAutoUpdate = false;
  object.onAfterRender = (renderer, _scene, _camera, geometry, material) =>
    draw(object, ranges, mode, renderer, geometry, material);
  object.onAfterShadow = (renderer, _scene, _camera, _shadowCamera, geometry, material) =>
    draw(object, ranges, mode, renderer as WebGLRenderer, geometry, material);
  // UmbelMesh casts rays itself.
  object.raycast = () => {};
}

/** Matrices of instances, which several batches share. */
export interface InstanceMatrices {
  attribute: InstancedBufferAttribute;
  count: number;
}

interface Drawn extends Object3D {
  instances?: InstanceMatrices | undefined;
}

/** Draws an object once for each matrix. three.js knows instanced meshes by these properties. */
export function setInstances(object: Batch | LineBatch, instances: InstanceMatrices): void {
  object.instances = instances;
  Object.assign(object, {
    isInstancedMesh: true,
    instanceMatrix: instances.attribute,
    instanceColor: null,
    morphTexture: null,
    count: instances.count,
  });
}

/**
 * Sets the box of an object, before its matrix. three.js would take that of the geometry, which holds
 * other vertices, too.
 */
export function setBounds(object: Batch | LineBatch, boundingBox: Box3): void {
  Object.assign(object, {
    boundingBox,
    boundingSphere: boundingBox.getBoundingSphere(new Sphere()),
  });
}

export class Batch extends Mesh<BufferGeometry, Material> {
  readonly ranges = new Ranges();
  instances: InstanceMatrices | undefined;
  boundingBox: Box3 | undefined;

  constructor(geometry: BufferGeometry, material: Material) {
    super(geometry, material);
    setUp(this, this.ranges, "TRIANGLES");
  }

  /** For precise boxes of three.js: corners of the box, not vertices of whatever the geometry holds. */
  override getVertexPosition(index: number, target: Vector3): Vector3 {
    if (!this.boundingBox) return super.getVertexPosition(index, target);
    const { min, max } = this.boundingBox;
    const at = (bit: number) => (index & bit ? max : min);
    return target.set(at(1).x, at(2).y, at(4).z);
  }
}

export class LineBatch extends LineSegments<BufferGeometry, Material> {
  readonly ranges = new Ranges();
  instances: InstanceMatrices | undefined;

  constructor(geometry: BufferGeometry, material: Material) {
    super(geometry, material);
    setUp(this, this.ranges, "LINES");
  }
}
