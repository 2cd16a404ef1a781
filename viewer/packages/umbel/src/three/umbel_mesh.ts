// An asset as an object of a three.js scene.
//
//     const mesh = await UmbelMesh.load("dragon.umbel");
//     scene.add(mesh);
//     // every frame:
//     mesh.update(camera, renderer);
//     renderer.render(scene, camera);

import {
  Box3,
  type Camera,
  Frustum,
  type Intersection,
  type Material,
  Matrix4,
  Object3D,
  type OrthographicCamera,
  type PerspectiveCamera,
  type Ray,
  type Raycaster,
  Vector2,
  Vector3,
  type WebGLRenderer,
} from "three";
import { boundsOf } from "../bounds.js";
import type { RenderGroup } from "../pack.js";
import { cameraView, type View } from "../select.js";
import { AssetStream } from "../stream.js";
import type { AssetInfo, StreamStatistics, StreamUpdate } from "../streamer.js";
import { Allocator } from "./allocator.js";
import { Arena, type Layout, type Place } from "./arena.js";
import { Batch, LineBatch } from "./batch.js";
import { Materials } from "./materials.js";
import { Tint } from "./tint.js";

export interface UmbelMeshOptions {
  /** Bytes of memory for geometry; 256 MiB if not said. */
  budget?: number;
  /** How many pixels what is drawn may be from the full mesh; 1 if not said. */
  pixelError?: number;
  /** How many times that where the camera does not look; 4 if not said. */
  offscreen?: number;
}

/** A cluster that is in memory. */
export interface ClusterInfo {
  cluster: number;
  group: number;
  level: number;
  /** Of the cluster's own form: how far it may be from the full mesh. */
  error: number;
  /** Of the group once simplified; infinite for a root. */
  groupError: number;
  generating: number;
  material: number;
  triangles: number;
  vertices: number;
  /** In the mesh's own space; the instance's matrix brings it into the object's. */
  box: Box3;
  instance: number;
  matrix: Matrix4;
  /** Whether something finer is wanted here but has not arrived. */
  waits: boolean;
}

/** A colour for a cluster: red, green, blue (sRGB) and how much it covers, 0 to 1. */
export type TintFunction = (cluster: ClusterInfo) => readonly [number, number, number, number];

export interface UmbelIntersection extends Intersection {
  cluster: ClusterInfo;
}

/** An asset's mesh where it stands in the object, and what is drawn of it. */
interface Instance {
  mesh: number;
  /** From the mesh to the object, and back. */
  matrix: Matrix4;
  cut: Uint32Array;
  /** The groups of the cut's runs. */
  groups: Resident[];
  batches: Map<Arena, Batch[]>;
  lines: Map<Arena, LineBatch>;
}

/** A group in memory and where it is. */
interface Resident {
  group: RenderGroup;
  arena: Arena;
  place: Place;
  box: Box3;
}

/** Time to bring new groups to the GPU in a frame, in milliseconds. */
const UPLOAD_TIME = 6;
const DEFAULT_BUDGET = 2 ** 28;
const MAX_SLOTS = 1 << 22;

export class UmbelMesh extends Object3D {
  /** Pixels that what is drawn may be from the full mesh. */
  pixelError: number;
  /** While true, what is drawn stays as it is, wherever the camera goes. */
  isFrozen = false;
  statistics: StreamStatistics | undefined;
  /** For each page, in the order of the file: 0 absent, 1 loading, 2 resident, 3 damaged. */
  pages: Uint8Array = new Uint8Array(0);
  /** Draw calls, triangles and clusters of the last frame, after culling. */
  readonly drawn = { calls: 0, triangles: 0, clusters: 0 };
  /** The greatest error that is not infinite, of what has arrived. */
  coarsestError = 0;
  /** Rises whenever other clusters are to be drawn. */
  cutVersion = 0;
  /** Time of `update` on the page's thread in the last frame, in milliseconds. */
  updateTime = 0;
  readonly materials: Materials;
  /** Told of each material that is made, as groups that have it arrive. */
  onMaterial: ((material: Material) => void) | undefined;
  readonly box: Box3;
  onConnection: ((isLost: boolean) => void) | undefined;
  /** Told when something has arrived or changed, so that a frame is worth drawing. */
  onChange: (() => void) | undefined;

  private readonly layouts: Layout[];
  private readonly instances: Instance[];
  private readonly offscreen: number;
  private readonly queue: StreamUpdate[] = [];
  private readonly arenas = new Set<Arena>();
  private readonly resident = new Map<number, Resident>();
  private readonly slots = new Allocator(MAX_SLOTS);
  private readonly tint = new Tint();
  private tintFunction: TintFunction | undefined;
  private lineMaterial: Material | undefined;
  private lastView = "";

  /** Of a stream that is open; its budget stays as it was opened with. */
  constructor(
    private readonly stream: AssetStream,
    options: Omit<UmbelMeshOptions, "budget"> = {},
  ) {
    super();
    stream.listener = {
      update: (update) => this.receive(update),
      connection: (isLost) => this.onConnection?.(isLost),
    };
    this.pixelError = options.pixelError ?? 1;
    this.offscreen = options.offscreen ?? 4;
    const { meshes, instances } = stream.info;
    this.layouts = meshes.map(({ attributes }) => ({
      normals: attributes.includes("normals"),
      uvs: attributes.includes("uvs"),
      colors: attributes.includes("colors"),
    }));
    this.instances = instances.map(({ mesh, matrix }) => ({
      mesh,
      matrix: matrixOf(matrix),
      cut: new Uint32Array(0),
      groups: [],
      batches: new Map(),
      lines: new Map(),
    }));
    const { low, high } = boundsOf(stream.info);
    this.box = new Box3(new Vector3(...low), new Vector3(...high));
    this.materials = new Materials(
      stream,
      (material) => {
        this.tint.applyTo(material);
        this.onMaterial?.(material);
      },
      () => this.onChange?.(),
    );
  }

  /** Opens the asset at an address or in a local file; rejects with an UmbelError. */
  static async load(source: string | Blob, options: UmbelMeshOptions = {}): Promise<UmbelMesh> {
    const budget = options.budget ?? DEFAULT_BUDGET;
    return new UmbelMesh(await AssetStream.open(source, { budget }), options);
  }

  get info(): AssetInfo {
    return this.stream.info;
  }

  setBudget(bytes: number): void {
    this.stream.setBudget(bytes);
  }

  /** Colours clusters; undefined takes the colours away. */
  setTint(tint: TintFunction | undefined): void {
    this.tintFunction = tint;
    this.paint();
  }

  /** Draws the edges of triangles with a material (or no longer, if undefined). */
  setLines(material: Material | undefined): void {
    if (material === this.lineMaterial) return;
    this.lineMaterial = material;
    for (const { lines } of this.instances) {
      for (const batch of lines.values()) this.remove(batch);
      lines.clear();
    }
  }

  /** Frees all memory; the object is of no use after that. */
  override dispose(): void {
    this.stream.close();
    this.removeFromParent();
    this.clear();
    for (const arena of this.arenas) arena.dispose();
    this.materials.dispose();
    this.tint.dispose();
    this.arenas.clear();
    this.resident.clear();
    this.queue.length = 0;
  }

  /** To be called before each frame: takes what has arrived, asks for what is seen. */
  update(camera: Camera, renderer: WebGLRenderer): void {
    const start = performance.now();
    this.updateWorldMatrix(true, false);
    camera.updateWorldMatrix(true, false);
    this.receiveQueued(start);
    if (!this.isFrozen) this.look(camera, renderer.getDrawingBufferSize(new Vector2()).y);
    this.makeRanges(camera);
    this.updateTime = performance.now() - start;
  }

  /** The clusters that are drawn, culled ones too; of every instance. */
  *clusters(): Generator<ClusterInfo> {
    for (let i = 0; i < this.instances.length; ++i) yield* this.instanceClusters(i);
  }

  private *instanceClusters(number: number): Generator<ClusterInfo> {
    const { cut, groups, matrix } = this.instances[number] as Instance;
    for (let i = 0; i < groups.length; ++i) {
      const first = cut[3 * i];
      for (let c = first; c < first + cut[3 * i + 1]; ++c) {
        const info = clusterInfo((groups[i] as Resident).group, c, cut[3 * i + 2] === 1);
        yield { ...info, instance: number, matrix };
      }
    }
  }

  override raycast(raycaster: Raycaster, intersections: Intersection[]): void {
    const world = new Matrix4();
    const point = new Vector3();
    this.instances.forEach(({ matrix }, number) => {
      world.multiplyMatrices(this.matrixWorld, matrix);
      const ray = raycaster.ray.clone().applyMatrix4(world.clone().invert());
      for (const cluster of this.instanceClusters(number)) {
        if (!ray.intersectsBox(cluster.box)) continue;
        const hit = this.intersectCluster(ray, cluster);
        if (!hit) continue;
        point.copy(hit).applyMatrix4(world);
        const distance = raycaster.ray.origin.distanceTo(point);
        if (distance < raycaster.near || distance > raycaster.far) continue;
        const found: UmbelIntersection = { distance, point: point.clone(), object: this, cluster };
        intersections.push(found);
      }
    });
  }

  private intersectCluster(ray: Ray, { group, cluster }: ClusterInfo): Vector3 | undefined {
    const resident = this.resident.get(group);
    if (!resident) return undefined;
    const { triangleOffsets, firstCluster } = resident.group;
    const { indices, positions } = resident.place;
    const i = cluster - firstCluster;
    const corners = [new Vector3(), new Vector3(), new Vector3()] as const;
    const point = new Vector3();
    let nearest: Vector3 | undefined;
    for (let t = triangleOffsets[i]; t < triangleOffsets[i + 1]; ++t) {
      corners.forEach((corner, j) => {
        corner.fromArray(positions, 3 * indices[3 * t + j]);
      });
      if (!ray.intersectTriangle(...corners, false, point)) continue;
      if (!nearest || ray.origin.distanceTo(point) < ray.origin.distanceTo(nearest))
        nearest = point.clone();
    }
    return nearest;
  }

  private receive(update: StreamUpdate): void {
    this.queue.push(update);
    this.onChange?.();
  }

  private receiveQueued(start: number): void {
    let changed = false;
    while (this.queue.length > 0) {
      if (changed && performance.now() - start > UPLOAD_TIME) {
        this.onChange?.();
        break;
      }
      this.take(this.queue.shift() as StreamUpdate);
      changed = true;
    }
    if (changed && this.tintFunction) this.paint();
  }

  private take(update: StreamUpdate): void {
    for (const group of update.removed) this.removeGroup(group);
    for (const group of update.added) this.addGroup(group);
    this.statistics = update.statistics;
    this.pages = update.pages;
    if (!update.cuts) return;
    const groupOf = this.groupsByCluster();
    update.cuts.forEach((cut, i) => {
      const instance = this.instances[i] as Instance;
      instance.cut = cut;
      instance.groups = [];
      for (let run = 0; run < cut.length; run += 3)
        instance.groups.push(groupOf.get(cut[run]) as Resident);
    });
    ++this.cutVersion;
  }

  private groupsByCluster(): Map<number, Resident> {
    const groups = new Map<number, Resident>();
    for (const resident of this.resident.values()) {
      const { firstCluster, clusterCount } = resident.group;
      for (let c = firstCluster; c < firstCluster + clusterCount; ++c) groups.set(c, resident);
    }
    return groups;
  }

  private addGroup(group: RenderGroup): void {
    const slot = this.slots.take(group.clusterCount);
    this.tint.reserve(slot + group.clusterCount);
    let [arena, place] = this.findRoom(group, slot);
    if (!place) {
      arena = new Arena(this.layouts[group.mesh] as Layout, group);
      this.arenas.add(arena);
      place = arena.put(group, slot);
    }
    const box = new Box3();
    for (let i = 0; i < group.clusterCount; ++i) box.union(boxOf(group, i));
    this.coarsestError = Math.max(this.coarsestError, ...group.generatingError);
    this.resident.set(group.group, { group, arena: arena as Arena, place: place as Place, box });
  }

  private findRoom(group: RenderGroup, slot: number): [Arena?, Place?] {
    const layout = this.layouts[group.mesh] as Layout;
    for (const arena of this.arenas) {
      if (!isSameLayout(arena.layout, layout)) continue;
      const place = arena.put(group, slot);
      if (place) return [arena, place];
    }
    return [];
  }

  private removeGroup(group: number): void {
    const resident = this.resident.get(group);
    if (!resident) return;
    this.resident.delete(group);
    this.slots.give(resident.place.slot, resident.group.clusterCount);
    resident.arena.remove(resident.group);
    if (resident.arena.isEmpty) this.removeArena(resident.arena);
  }

  private removeArena(arena: Arena): void {
    for (const { batches, lines } of this.instances) {
      for (const batch of batches.get(arena) ?? []) if (batch) this.remove(batch);
      const line = lines.get(arena);
      if (line) this.remove(line);
      batches.delete(arena);
      lines.delete(arena);
    }
    this.arenas.delete(arena);
    arena.dispose();
  }

  /** Tells the stream what the camera sees, if that has changed. */
  private look(camera: Camera, height: number): void {
    const key = [
      height,
      this.pixelError,
      ...camera.matrixWorld.elements,
      ...camera.projectionMatrix.elements,
      ...this.matrixWorld.elements,
    ].join();
    if (key === this.lastView) return;
    this.lastView = key;
    const world = new Matrix4();
    this.stream.setViews(
      this.instances.map(({ mesh, matrix }) => {
        world.multiplyMatrices(this.matrixWorld, matrix);
        return { mesh, view: viewOf(camera, world, height, this.pixelError, this.offscreen) };
      }),
    );
  }

  /** Lists what of the cuts is in view, for the GPU. */
  private makeRanges(camera: Camera): void {
    const { drawn } = this;
    drawn.calls = drawn.triangles = drawn.clusters = 0;
    const world = new Matrix4();
    for (const instance of this.instances) {
      const all = [...[...instance.batches.values()].flat(), ...instance.lines.values()];
      for (const batch of all) batch?.ranges.clear();
      world.multiplyMatrices(this.matrixWorld, instance.matrix);
      this.addRuns(instance, frustumOf(camera, world));
      for (const batches of instance.batches.values())
        for (const batch of batches) this.show(batch);
      for (const batch of instance.lines.values()) this.show(batch);
    }
  }

  private show(batch: Batch | LineBatch | undefined): void {
    if (!batch) return;
    batch.visible = batch.ranges.length > 0;
    if (batch.visible) ++this.drawn.calls;
  }

  private addRuns(instance: Instance, frustum: Frustum): void {
    const isVisible = new Map<Resident, boolean>();
    instance.groups.forEach((resident, i) => {
      let visible = isVisible.get(resident);
      if (visible === undefined) {
        visible = frustum.intersectsBox(resident.box);
        isVisible.set(resident, visible);
      }
      if (visible) this.addRun(instance, resident, instance.cut[3 * i], instance.cut[3 * i + 1]);
    });
  }

  private addRun(instance: Instance, resident: Resident, first: number, count: number): void {
    const { group, arena, place } = resident;
    const { triangleOffsets, material } = group;
    const begin = first - group.firstCluster;
    const end = begin + count;
    for (let i = begin; i < end; ++i) {
      const start = triangleOffsets[i];
      let j = i + 1;
      while (j < end && material[j] === material[i]) ++j;
      const triangles = triangleOffsets[j] - start;
      const batch = this.batch(instance, arena, material[i]);
      batch.ranges.add(place.index + 3 * start, 3 * triangles);
      this.drawn.triangles += triangles;
      i = j - 1;
    }
    this.drawn.clusters += count;
    if (!this.lineMaterial) return;
    const lines = this.lines(instance, arena, this.lineMaterial);
    const edges = arena.edgesOf(group);
    if (edges) lines.ranges.add(edges[begin], edges[end] - edges[begin]);
  }

  private batch(instance: Instance, arena: Arena, material: number): Batch {
    let batches = instance.batches.get(arena);
    if (!batches) {
      batches = [];
      instance.batches.set(arena, batches);
    }
    let batch = batches[material];
    if (!batch) {
      const used = this.materials.of(material, arena.layout);
      batch = this.place(new Batch(arena.geometry, used), instance);
      batches[material] = batch;
    }
    return batch;
  }

  private lines(instance: Instance, arena: Arena, material: Material): LineBatch {
    let lines = instance.lines.get(arena);
    if (!lines) {
      lines = this.place(new LineBatch(arena.lines(), material), instance);
      instance.lines.set(arena, lines);
    }
    return lines;
  }

  private place<T extends Object3D>(object: T, { matrix }: Instance): T {
    object.matrix.copy(matrix);
    this.add(object);
    object.updateMatrixWorld(true);
    return object;
  }

  private paint(): void {
    const { tintFunction } = this;
    if (!tintFunction) {
      this.tint.clear();
      return;
    }
    for (const info of this.clusters()) {
      const resident = this.resident.get(info.group) as Resident;
      const slot = resident.place.slot + info.cluster - resident.group.firstCluster;
      this.tint.set(slot, ...tintFunction(info));
    }
    this.tint.update();
  }
}

function boxOf(group: RenderGroup, i: number): Box3 {
  return new Box3(
    new Vector3().fromArray(group.boxes, 6 * i),
    new Vector3().fromArray(group.boxes, 6 * i + 3),
  );
}

function clusterInfo(
  group: RenderGroup,
  cluster: number,
  waits: boolean,
): Omit<ClusterInfo, "instance" | "matrix"> {
  const i = cluster - group.firstCluster;
  return {
    cluster,
    group: group.group,
    level: group.level,
    error: group.generatingError[i],
    groupError: group.error,
    generating: group.generating[i],
    material: group.material[i],
    triangles: group.triangleOffsets[i + 1] - group.triangleOffsets[i],
    vertices: group.vertexOffsets[i + 1] - group.vertexOffsets[i],
    box: boxOf(group, i),
    waits,
  };
}

function isSameLayout(a: Layout, b: Layout): boolean {
  return a.normals === b.normals && a.uvs === b.uvs && a.colors === b.colors;
}

/** Of three rows of four. */
function matrixOf(rows: Float32Array): Matrix4 {
  return new Matrix4().fromArray([...rows, 0, 0, 0, 1]).transpose();
}

function frustumOf(camera: Camera, world: Matrix4): Frustum {
  const matrix = new Matrix4()
    .multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse)
    .multiply(world);
  return new Frustum().setFromProjectionMatrix(matrix);
}

/** What selection needs of a camera, in the object's own coordinates. */
function viewOf(
  camera: Camera,
  world: Matrix4,
  height: number,
  pixelError: number,
  offscreen: number,
): View {
  const scale = new Vector3().setFromMatrixScale(world);
  const [low, high] = [Math.min(...scale), Math.max(...scale)];
  if ((camera as OrthographicCamera).isOrthographicCamera) {
    const { top, bottom, zoom } = camera as OrthographicCamera;
    return { kind: "error", error: (pixelError * (top - bottom)) / (zoom * height * high) };
  }
  const eye = new Vector3().setFromMatrixPosition(camera.matrixWorld);
  eye.applyMatrix4(world.clone().invert());
  const fov = ((camera as PerspectiveCamera).getEffectiveFOV() * Math.PI) / 180;
  // Where an axis is stretched, errors grow most with the longest and distances least.
  const view = cameraView([eye.x, eye.y, eye.z], fov, height, (pixelError * low) / high);
  const sides = frustumOf(camera, world).planes.slice(0, 4);
  view.planes = Float32Array.from(
    sides.flatMap(({ normal, constant }) => [normal.x, normal.y, normal.z, constant]),
  );
  view.offscreen = offscreen;
  return view;
}
