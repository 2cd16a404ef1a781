// Draws many ranges of one geometry in one call, with any material.
//
// The object's own draw range is empty: three.js binds the program, the buffers and the state, and
// draws nothing. The ranges are drawn right after, while those are bound.

import {
  type BufferGeometry,
  LineSegments,
  type Material,
  Mesh,
  type Object3D,
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

/** Ranges of indices, in the form of WEBGL_multi_draw. */
export class Ranges {
  counts = new Int32Array(256);
  offsets = new Int32Array(256);
  length = 0;

  clear(): void {
    this.length = 0;
  }

  /** Adds a range of indices; merges it with the last where it continues that. */
  add(start: number, count: number): void {
    const last = this.length - 1;
    if (last >= 0 && this.offsets[last] + 4 * this.counts[last] === 4 * start) {
      this.counts[last] += count;
      return;
    }
    if (this.length === this.counts.length) this.grow();
    this.offsets[this.length] = 4 * start;
    this.counts[this.length++] = count;
  }

  private grow(): void {
    const { counts, offsets } = this;
    this.counts = new Int32Array(2 * counts.length);
    this.offsets = new Int32Array(2 * offsets.length);
    this.counts.set(counts);
    this.offsets.set(offsets);
  }

  draw(renderer: WebGLRenderer, mode: "TRIANGLES" | "LINES"): void {
    if (this.length === 0) return;
    const gl = renderer.getContext() as WebGL2RenderingContext;
    const multi = renderer.extensions.get("WEBGL_multi_draw") as MultiDraw | null;
    const { counts, offsets, length } = this;
    if (multi)
      multi.multiDrawElementsWEBGL(gl[mode], counts, 0, gl.UNSIGNED_INT, offsets, 0, length);
    else
      for (let i = 0; i < length; ++i)
        gl.drawElements(gl[mode], counts[i], gl.UNSIGNED_INT, offsets[i]);
  }
}

function setUp(object: Object3D, ranges: Ranges, mode: "TRIANGLES" | "LINES"): void {
  object.frustumCulled = false;
  object.matrixAutoUpdate = false;
  object.onAfterRender = (renderer) => ranges.draw(renderer, mode);
  object.onAfterShadow = (renderer) => ranges.draw(renderer as WebGLRenderer, mode);
  // UmbelMesh casts rays itself.
  object.raycast = () => {};
}

export class Batch extends Mesh<BufferGeometry, Material> {
  readonly ranges = new Ranges();

  constructor(geometry: BufferGeometry, material: Material) {
    super(geometry, material);
    setUp(this, this.ranges, "TRIANGLES");
  }
}

export class LineBatch extends LineSegments<BufferGeometry, Material> {
  readonly ranges = new Ranges();

  constructor(geometry: BufferGeometry, material: Material) {
    super(geometry, material);
    setUp(this, this.ranges, "LINES");
  }
}
