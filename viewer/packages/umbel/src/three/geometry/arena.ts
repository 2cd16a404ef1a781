// A piece of GPU memory that many groups share, so that all their clusters are drawn by one call.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage } from "three";
import { UV_SETS } from "../../format/attributes.js";
import type { RenderGroup } from "../../stream/render_group.js";
import { Allocator } from "./allocator.js";
import { clusterEdges } from "./edges.js";

const VERTICES = 1 << 17;
/** More than a closed surface has in clusters of 128. */
const TRIANGLES_PER_VERTEX = 1.75;

/** Which attributes an arena's vertices have. */
export interface Layout {
  normals: boolean;
  tangents: boolean;
  /** For each set of texture coordinates. */
  uvs: readonly boolean[];
  colors: boolean;
}

/** Where a group is. */
export interface Place {
  vertex: number;
  vertexCount: number;
  /** The first index; three a triangle. */
  index: number;
  slot: number;
  /** The arena's positions, and the group's part of its indices. */
  positions: Float32Array;
  indices: Uint32Array;
}

export class Arena {
  readonly geometry = new BufferGeometry();
  /** The same vertices with the edges of triangles; made when first asked for. */
  private edges: BufferGeometry | undefined;
  private readonly vertices: Allocator;
  private readonly indices: Allocator;
  private readonly contents = new Map<RenderGroup, Place>();
  private readonly edgeOffsets = new Map<RenderGroup, Uint32Array>();

  constructor(
    readonly layout: Layout,
    first: RenderGroup,
  ) {
    const vertices = Math.max(VERTICES, first.positions.length / 3);
    const indices = Math.max(3 * Math.ceil(VERTICES * TRIANGLES_PER_VERTEX), first.indices.length);
    this.vertices = new Allocator(vertices);
    this.indices = new Allocator(indices);
    const add = (
      name: string,
      array: Float32Array | Int16Array | Uint16Array | Uint32Array,
      size: number,
    ) => {
      const isNormalised = array instanceof Int16Array || array instanceof Uint16Array;
      this.geometry.setAttribute(name, dynamic(new BufferAttribute(array, size, isNormalised)));
    };
    add("position", new Float32Array(3 * vertices), 3);
    add("umbelSlot", new Uint32Array(vertices), 1);
    if (layout.normals) add("normal", new Int16Array(4 * vertices), 4);
    if (layout.tangents) add("tangent", new Int16Array(4 * vertices), 4);
    layout.uvs.forEach((has, set) => {
      if (has) add(uvName(set), new Float32Array(2 * vertices), 2);
    });
    if (layout.colors) add("color", new Uint16Array(4 * vertices), 4);
    this.geometry.setIndex(dynamic(new BufferAttribute(new Uint32Array(indices), 1)));
    // Nothing is drawn by three.js itself: see Batch.
    this.geometry.setDrawRange(0, 0);
  }

  /** Moves a group's arrays in, and empties them; undefined if there is no room for it. */
  put(group: RenderGroup, slot: number): Place | undefined {
    const vertexCount = group.positions.length / 3;
    const vertex = this.vertices.take(vertexCount);
    if (vertex < 0) return undefined;
    const index = this.indices.take(group.indices.length);
    if (index < 0) {
      this.vertices.give(vertex, vertexCount);
      return undefined;
    }
    this.write("position", group.positions, vertex);
    if (group.normals) this.write("normal", group.normals, vertex);
    if (group.tangents) this.write("tangent", group.tangents, vertex);
    UV_SETS.forEach((name, set) => {
      const uvs = group[name];
      if (uvs) this.write(uvName(set), uvs, vertex);
    });
    if (group.colors) this.write("color", group.colors, vertex);
    this.writeSlots(group, vertex, slot);
    const indices = this.geometry.index as BufferAttribute;
    for (let i = 0; i < group.indices.length; ++i)
      indices.array[index + i] = group.indices[i] + vertex;
    touch(indices, index, group.indices.length);
    const place = {
      vertex,
      vertexCount,
      index,
      slot,
      positions: this.geometry.getAttribute("position").array as Float32Array,
      indices: (indices.array as Uint32Array).subarray(index, index + group.indices.length),
    };
    empty(group);
    this.contents.set(group, place);
    if (this.edges) this.addEdges(this.edges, group, place);
    return place;
  }

  remove(group: RenderGroup): void {
    const place = this.contents.get(group);
    if (!place) return;
    this.vertices.give(place.vertex, place.vertexCount);
    this.indices.give(place.index, place.indices.length);
    this.contents.delete(group);
    this.edgeOffsets.delete(group);
  }

  get isEmpty(): boolean {
    return this.contents.size === 0;
  }

  /** The geometry of lines; from now on edges of what comes are made at once. */
  lines(): BufferGeometry {
    if (this.edges) return this.edges;
    const edges = new BufferGeometry();
    for (const [name, attribute] of Object.entries(this.geometry.attributes))
      edges.setAttribute(name, attribute);
    // Every triangle has room for three edges of its own.
    const room = 2 * (this.geometry.index as BufferAttribute).count;
    edges.setIndex(dynamic(new BufferAttribute(new Uint32Array(room), 1)));
    edges.setDrawRange(0, 0);
    this.edges = edges;
    for (const [group, place] of this.contents) this.addEdges(edges, group, place);
    return edges;
  }

  /** Where the edges of each cluster begin in the lines' index, and behind the last. */
  edgesOf(group: RenderGroup): Uint32Array | undefined {
    return this.edgeOffsets.get(group);
  }

  dispose(): void {
    this.edges?.dispose();
    this.geometry.dispose();
  }

  private addEdges(edges: BufferGeometry, group: RenderGroup, place: Place): void {
    const index = edges.index as BufferAttribute;
    const offsets = clusterEdges(group, place, index.array as Uint32Array);
    this.edgeOffsets.set(group, offsets);
    touch(index, offsets[0], offsets[offsets.length - 1] - offsets[0]);
  }

  private write(name: string, values: ArrayLike<number>, vertex: number): void {
    const attribute = this.geometry.getAttribute(name) as BufferAttribute;
    const at = vertex * attribute.itemSize;
    attribute.array.set(values, at);
    touch(attribute, at, values.length);
  }

  private writeSlots(group: RenderGroup, vertex: number, slot: number): void {
    const attribute = this.geometry.getAttribute("umbelSlot") as BufferAttribute;
    const { vertexOffsets, clusterCount } = group;
    for (let i = 0; i < clusterCount; ++i)
      attribute.array.fill(slot + i, vertex + vertexOffsets[i], vertex + vertexOffsets[i + 1]);
    touch(attribute, vertex, vertexOffsets[clusterCount]);
  }
}

/** As three.js calls a set of texture coordinates. */
function uvName(set: number): string {
  return set === 0 ? "uv" : `uv${set}`;
}

function empty(group: RenderGroup): void {
  group.positions = new Float32Array(0);
  group.indices = new Uint32Array(0);
  delete group.normals;
  delete group.tangents;
  for (const name of UV_SETS) delete group[name];
  delete group.colors;
}

function dynamic(attribute: BufferAttribute): BufferAttribute {
  return attribute.setUsage(DynamicDrawUsage);
}

function touch(attribute: BufferAttribute, start: number, count: number): void {
  attribute.addUpdateRange(start, count);
  attribute.needsUpdate = true;
}
