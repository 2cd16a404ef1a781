// Vertex and index buffers that many groups share, so that one call draws all their clusters.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage } from "three";
import { UV_SETS } from "../../format/attributes.js";
import type { RenderGroup } from "../../pack/render_group.js";
import { Allocator } from "./allocator.js";
import { clusterEdges } from "./edges.js";

/** Least and most room for triangles, a vertex: closed surfaces have up to 1.75, boxes 0.5. */
const TRIANGLES_PER_VERTEX = { low: 0.5, high: 1.75 };

/** The attributes of an arena's vertices. */
export interface VertexLayout {
  normals: boolean;
  tangents: boolean;
  /** For each set of texture coordinates. */
  uvs: readonly boolean[];
  colors: boolean;
}

/** Bytes of an arena for each of its vertices, triangles included, where there are most of those. */
export function mostBytesPerVertex({ normals, tangents, uvs, colors }: VertexLayout): number {
  const eights = [normals, tangents, ...uvs, colors].filter((has) => has).length;
  return 16 + 8 * eights + 12 * TRIANGLES_PER_VERTEX.high;
}

/** Where an arena holds a group. */
export interface Allocation {
  vertex: number;
  vertexCount: number;
  /** The first index; three a triangle. */
  index: number;
  /** The slot of the group's first cluster: a number that its vertices carry, for tints. */
  slot: number;
  /** Positions of the whole arena, and the indices of the group. */
  positions: Float32Array;
  indices: Uint32Array;
}

export class Arena {
  readonly geometry: BufferGeometry = new BufferGeometry();
  /** The same vertices, with edges as lines; made by the first call of `lines`. */
  private edges: BufferGeometry | undefined;
  private readonly vertices: Allocator;
  private readonly indices: Allocator;
  private readonly contents = new Map<RenderGroup, Allocation>();
  private readonly edgeOffsets = new Map<RenderGroup, Uint32Array>();
  /** Bytes of its buffers without the edges, and of those parts of them that groups use. */
  readonly capacity: number;
  used = 0;
  /** Vertices that it has room for. */
  readonly room: number;
  private readonly vertexBytes: number;

  /**
   * Has room for `room` vertices, or for the first group where that is more.
   * @param trianglesPerVertex that groups are expected to have
   */
  constructor(
    readonly layout: VertexLayout,
    first: RenderGroup,
    room: number,
    trianglesPerVertex: number = TRIANGLES_PER_VERTEX.high,
  ) {
    const vertices = Math.max(room, first.positions.length / 3);
    const { low, high } = TRIANGLES_PER_VERTEX;
    const ratio = Math.min(Math.max(trianglesPerVertex, low), high);
    const indices = Math.max(3 * Math.ceil(room * ratio), first.indices.length);
    this.room = vertices;
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
    const arrays = Object.values(this.geometry.attributes).map(({ array }) => array.byteLength);
    this.vertexBytes = arrays.reduce((sum, bytes) => sum + bytes, 0) / vertices;
    this.capacity = vertices * this.vertexBytes + 4 * indices;
    // Batch draws; three.js itself draws nothing.
    this.geometry.setDrawRange(0, 0);
  }

  /** Copies a group's arrays and empties the group; undefined if there is no room. */
  put(group: RenderGroup, slot: number): Allocation | undefined {
    const vertexCount = group.positions.length / 3;
    const vertex = this.vertices.allocate(vertexCount);
    if (vertex < 0) return undefined;
    const index = this.indices.allocate(group.indices.length);
    if (index < 0) {
      this.vertices.free(vertex, vertexCount);
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
    markChanged(indices, index, group.indices.length);
    const allocation = {
      vertex,
      vertexCount,
      index,
      slot,
      positions: this.geometry.getAttribute("position").array as Float32Array,
      indices: (indices.array as Uint32Array).subarray(index, index + group.indices.length),
    };
    empty(group);
    this.used += this.bytesOf(allocation);
    this.contents.set(group, allocation);
    if (this.edges) this.addEdges(this.edges, group, allocation);
    return allocation;
  }

  get allocations(): Iterable<[RenderGroup, Allocation]> {
    return this.contents.entries();
  }

  /** Whether it has room for as much as another arena's allocation. */
  fits({ vertexCount, indices }: Allocation): boolean {
    return this.vertices.fits(vertexCount) && this.indices.fits(indices.length);
  }

  /** Gives a group copies of its arrays, to put it elsewhere. */
  fill(group: RenderGroup): void {
    const { vertex, vertexCount, indices } = this.contents.get(group) as Allocation;
    const { layout } = this;
    const values = <Values extends Float32Array | Int16Array | Uint16Array>(name: string) => {
      const { array, itemSize } = this.geometry.getAttribute(name);
      return array.slice(itemSize * vertex, itemSize * (vertex + vertexCount)) as Values;
    };
    group.positions = values("position");
    group.indices = indices.map((i) => i - vertex);
    if (layout.normals) group.normals = values("normal");
    if (layout.tangents) group.tangents = values("tangent");
    UV_SETS.forEach((name, set) => {
      if (layout.uvs[set]) group[name] = values(uvName(set));
    });
    if (layout.colors) group.colors = values("color");
  }

  remove(group: RenderGroup): void {
    const allocation = this.contents.get(group);
    if (!allocation) return;
    this.vertices.free(allocation.vertex, allocation.vertexCount);
    this.indices.free(allocation.index, allocation.indices.length);
    this.used -= this.bytesOf(allocation);
    this.contents.delete(group);
    this.edgeOffsets.delete(group);
  }

  private bytesOf({ vertexCount, indices }: Allocation): number {
    return vertexCount * this.vertexBytes + indices.byteLength;
  }

  get isEmpty(): boolean {
    return this.contents.size === 0;
  }

  /** Bytes of the indices of edges. */
  get edgeBytes(): number {
    return this.edges?.index?.array.byteLength ?? 0;
  }

  /** The edges of all groups as lines; later groups add theirs when they arrive. */
  lines(): BufferGeometry {
    if (this.edges) return this.edges;
    const edges = new BufferGeometry();
    for (const [name, attribute] of Object.entries(this.geometry.attributes))
      edges.setAttribute(name, attribute);
    // There is room for three edges a triangle.
    const capacity = 2 * (this.geometry.index as BufferAttribute).count;
    edges.setIndex(dynamic(new BufferAttribute(new Uint32Array(capacity), 1)));
    edges.setDrawRange(0, 0);
    this.edges = edges;
    for (const [group, allocation] of this.contents) this.addEdges(edges, group, allocation);
    return edges;
  }

  /** First index of each cluster's lines, and the end of the last. */
  edgesOf(group: RenderGroup): Uint32Array | undefined {
    return this.edgeOffsets.get(group);
  }

  /** Frees the edges; those that `lines` returned cannot be drawn after that. */
  removeLines(): void {
    if (!this.edges) return;
    // Freeing a geometry frees its attributes too, which the triangles still need.
    for (const name of Object.keys(this.edges.attributes)) this.edges.deleteAttribute(name);
    this.edges.dispose();
    this.edges = undefined;
    this.edgeOffsets.clear();
  }

  dispose(): void {
    this.removeLines();
    this.geometry.dispose();
  }

  private addEdges(edges: BufferGeometry, group: RenderGroup, allocation: Allocation): void {
    const index = edges.index as BufferAttribute;
    const offsets = clusterEdges(group, allocation, index.array as Uint32Array);
    this.edgeOffsets.set(group, offsets);
    markChanged(index, offsets[0], offsets[offsets.length - 1] - offsets[0]);
  }

  private write(name: string, values: ArrayLike<number>, vertex: number): void {
    const attribute = this.geometry.getAttribute(name) as BufferAttribute;
    const at = vertex * attribute.itemSize;
    attribute.array.set(values, at);
    markChanged(attribute, at, values.length);
  }

  private writeSlots(group: RenderGroup, vertex: number, slot: number): void {
    const attribute = this.geometry.getAttribute("umbelSlot") as BufferAttribute;
    const { vertexOffsets, clusterCount } = group;
    for (let i = 0; i < clusterCount; ++i)
      attribute.array.fill(slot + i, vertex + vertexOffsets[i], vertex + vertexOffsets[i + 1]);
    markChanged(attribute, vertex, vertexOffsets[clusterCount]);
  }
}

/** three.js's name of a set of texture coordinates. */
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

function markChanged(attribute: BufferAttribute, start: number, count: number): void {
  attribute.addUpdateRange(start, count);
  attribute.needsUpdate = true;
}
