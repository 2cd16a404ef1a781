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
  type Intersection,
  type Material,
  Object3D,
  type Raycaster,
  Vector2,
  Vector3,
  type WebGLRenderer,
} from "three";
import { checkNumber, memoryError, type UmbelError } from "../errors.js";
import type { AssetInfo, MeshInfo } from "../stream/asset_info.js";
import { boundsOf } from "../stream/bounds.js";
import type { InstanceRow } from "../stream/instance_rows.js";
import type { StreamStatistics, StreamUpdate } from "../stream/stream_update.js";
import { AssetStream } from "../worker/asset_stream.js";
import { frustumOf } from "./camera_view.js";
import type { ClusterInfo, TintFunction } from "./cluster_info.js";
import { ClusterTint } from "./cluster_tint.js";
import { ResidentGroups } from "./geometry/resident_groups.js";
import { InstancedCut } from "./instanced_cut.js";
import { Materials } from "./materials/materials.js";
import { unsupportedFeatures } from "./materials/unsupported.js";
import { MemoryBudget } from "./memory_budget.js";
import { type DrawCounts, MeshInstance } from "./mesh_instance.js";
import { castRay, type SideOf } from "./raycast.js";
import { TexelDemand } from "./textures/texel_demand.js";
import type { TextureStatistics } from "./textures/textures.js";
import { UpdateQueue } from "./update_queue.js";
import { ViewTracker } from "./view_tracker.js";

export interface UmbelMeshOptions {
  /** Bytes of memory for geometry and textures; 256 MiB by default. */
  budget?: number;
  /** Allowed error of what is drawn, in pixels; 1 by default. */
  pixelError?: number;
  /** Factor on `pixelError` outside of the view volume; 4 by default. */
  offscreen?: number;
  /** Folder of basis_transcoder.js and .wasm, for KTX2; three.js's own by default, from r185 on. */
  basisPath?: string;
}

const DEFAULT_BUDGET = 2 ** 28;
/** Bytes of groups that wait to be uploaded before the stream rests. */
const MAX_WAITING_BYTES = 1 << 24;

export class UmbelMesh extends Object3D {
  private allowedError: number;
  /** While true, the cut stays as it is, wherever the camera goes. */
  isFrozen = false;
  statistics: StreamStatistics | undefined;
  /** The states of pages, by their number: 1 loading, 2 resident, 3 damaged; all others are absent. */
  readonly pages = new Map<number, number>();
  /** Draw calls, triangles and clusters of the last frame, after culling. */
  readonly drawn: DrawCounts = { calls: 0, triangles: 0, clusters: 0 };
  /** Rises whenever the cut changes. */
  cutVersion = 0;
  /** Milliseconds of the last call of `update`. */
  updateTime = 0;
  readonly materials: Materials;
  /** Contains the clusters of all levels of detail; coarse ones may stick out of the full mesh. */
  readonly box: Box3;
  /** Called with each new material. */
  onMaterial: ((material: Material) => void) | undefined;
  /** Called when the connection is lost or back. */
  onConnection: ((isLost: boolean) => void) | undefined;
  /** Called when parts stay coarse for a reason other than the connection: mostly, memory is short. */
  onError: ((error: UmbelError) => void) | undefined;
  /** Called when something has arrived or changed, so that a new frame differs from the last. */
  onChange: (() => void) | undefined;

  private instances: MeshInstance[];
  /** With a tree of instances: those of the last rows, by their keys. */
  private placed = new Map<string, MeshInstance>();
  private readonly residents: ResidentGroups;
  private readonly updates = new UpdateQueue();
  private isPaused = false;
  private readonly views: ViewTracker;
  private readonly budget: MemoryBudget;
  private readonly texelDemand = new TexelDemand();
  private readonly tint = new ClusterTint();
  private tintFunction: TintFunction | undefined;
  private lineMaterial: Material | undefined;
  private readonly offscreen: number;

  /** Shows an open stream; the budget stays as the stream was opened with. */
  constructor(
    private readonly stream: AssetStream,
    options: Omit<UmbelMeshOptions, "budget"> = {},
  ) {
    super();
    const { pixelError, offscreen } = checkedOptions(options);
    this.allowedError = pixelError;
    this.offscreen = offscreen;
    const { low, high } = boundsOf(stream.info);
    this.box = new Box3(new Vector3(...low), new Vector3(...high));
    this.materials = new Materials(
      stream,
      options.basisPath ?? "",
      (material) => {
        this.tint.applyTo(material);
        this.onMaterial?.(material);
      },
      () => {
        this.budget.update();
        this.onChange?.();
      },
    );
    for (const text of unsupportedFeatures(stream.info)) this.materials.note(text);
    this.budget = new MemoryBudget(stream, this.materials.textures, stream.budget);
    this.residents = new ResidentGroups(
      stream.info.meshes,
      () => this.budget.buffers,
      (slots) => this.tint.reserve(slots),
      (arena) => {
        for (const instance of this.instances) instance.removeArena(arena);
      },
    );
    this.instances = stream.info.hasInstanceTree
      ? []
      : stream.info.instances.map(
          (row, number) =>
            new MeshInstance(row, number, this, this.materials, this.boundsOf(row.mesh)),
        );
    this.views = new ViewTracker(stream, this.instances);
    stream.listener = {
      update: (update) => {
        this.updates.push(update);
        this.pauseIfBusy();
        this.onChange?.();
      },
      connection: (isLost) => this.onConnection?.(isLost),
      failed: (error) => this.onError?.(error),
    };
  }

  /** Opens the asset at an address or in a local file; rejects with an UmbelError. */
  static async load(source: string | Blob, options: UmbelMeshOptions = {}): Promise<UmbelMesh> {
    const budget = options.budget ?? DEFAULT_BUDGET;
    checkedOptions(options);
    return new UmbelMesh(await AssetStream.open(source, { budget }), options);
  }

  /** Allowed error of what is drawn, in pixels. */
  get pixelError(): number {
    return this.allowedError;
  }

  set pixelError(pixels: number) {
    checkNumber("pixelError", pixels, false);
    this.allowedError = pixels;
  }

  get info(): AssetInfo {
    return this.stream.info;
  }

  /** Position of the object's zero in the asset's world, in binary64. */
  get origin(): readonly [number, number, number] {
    return this.stream.info.origin;
  }

  /**
   * Positions the object in a scene whose zero is at `origin` of the world. Assets with different
   * origins then have the right relative position.
   */
  setSceneOrigin(origin: readonly [number, number, number]): void {
    if (origin.length !== 3 || !origin.every(Number.isFinite))
      throw new RangeError(`\`origin\` must be three finite numbers; it is ${origin.join(", ")}.`);
    const [x, y, z] = this.origin;
    this.position.set(x - origin[0], y - origin[1], z - origin[2]);
  }

  /** The largest finite error of all groups so far. */
  get coarsestError(): number {
    return this.residents.coarsestError;
  }

  /** Counts of the textures; `statistics` are of the geometry. */
  get textures(): TextureStatistics {
    const { isComplete, ...counts } = this.materials.textures.statistics;
    const isMeasured = this.texelDemand.isDone && this.drawn.triangles > 0;
    const isKnown = isMeasured || !this.materials.textures.hasAny;
    return { ...counts, isComplete: isComplete && isKnown };
  }

  /** Whether all selected geometry has arrived, for the view of the last update. */
  get isCutSettled(): boolean {
    const isCurrent = this.updates.isEmpty && this.statistics?.revision === this.stream.revision;
    return isCurrent && this.statistics?.isSettled === true;
  }

  /** Whether all selected geometry and textures have arrived, for the view of the last update. */
  get isSettled(): boolean {
    return (
      this.isCutSettled &&
      this.texelDemand.isDone &&
      this.materials.textures.statistics.missing === 0
    );
  }

  /** Sets the bytes of memory for geometry and textures. */
  setBudget(bytes: number): void {
    checkNumber("budget", bytes, true);
    this.texelDemand.isDone = false;
    this.budget.set(bytes);
  }

  /** Tints clusters; undefined removes the tints. */
  setTint(tint: TintFunction | undefined): void {
    this.tintFunction = tint;
    this.paint();
  }

  /** Draws the edges of triangles with a material; undefined removes them. */
  setLines(material: Material | undefined): void {
    if (material === this.lineMaterial) return;
    this.lineMaterial = material;
    for (const instance of this.instances) instance.removeLines();
    if (!material) this.residents.removeLines();
  }

  /** Not supported. */
  override clone(): never {
    throw new Error("An UmbelMesh cannot be cloned: load its asset once more.");
  }

  /** Frees all memory; the object cannot be used after that. */
  override dispose(): void {
    this.stream.close();
    for (const instance of this.instances) instance.dispose();
    this.removeFromParent();
    this.clear();
    this.residents.dispose();
    this.materials.dispose();
    this.tint.dispose();
    this.texelDemand.dispose();
    this.updates.clear();
  }

  /** Applies what has arrived and requests what is visible. To be called before each frame. */
  update(camera: Camera, renderer: WebGLRenderer): void {
    if (!renderer.extensions)
      throw new TypeError("An UmbelMesh is drawn by a WebGLRenderer, not by other renderers.");
    const start = performance.now();
    this.updateWorldMatrix(true, false);
    camera.updateWorldMatrix(true, false);
    this.applyUpdates(start);
    const { y: height } = renderer.getDrawingBufferSize(new Vector2());
    const { pixelError, offscreen } = this;
    // Without a cut there is none to keep.
    if (!this.isFrozen || this.views.version === 0)
      this.views.update({ camera, height, pixelError, offscreen }, this.matrixWorld);
    this.cullAndCount(camera);
    this.budget.setEdges(this.residents.edgeRatio);
    const key = `${this.views.version} ${this.cutVersion}`;
    this.texelDemand.update(this.instances, camera, height, key, {
      measured: (texels) => this.materials.textures.setDemand(texels, renderer),
      again: () => this.onChange?.(),
    });
    if (this.drawn.triangles > 0 && this.texelDemand.isDone) this.materials.textures.beginFrame();
    this.updateTime = performance.now() - start;
  }

  /**
   * The box of what is drawn, also outside of the picture: that of the full mesh, up to the error. It
   * is `box` while nothing is drawn, and with a tree of instances.
   */
  shownBox(): Box3 {
    const box = new Box3();
    if (!this.info.hasInstanceTree) for (const instance of this.instances) instance.expand(box);
    return box.isEmpty() ? this.box : box;
  }

  /** The clusters of the cut, of every instance, culled ones included. */
  *clusters(): Generator<ClusterInfo> {
    for (const instance of this.instances) yield* instance.clusters();
  }

  override raycast(raycaster: Raycaster, intersections: Intersection[]): void {
    const sideOf: SideOf = (material, layout) => this.materials.sideOf(material, layout);
    castRay(this, this.instances, this.residents, sideOf, raycaster, intersections);
  }

  private applyUpdates(start: number): void {
    let count = 0;
    let hasMoved = false;
    try {
      count = this.updates.apply(start, {
        add: (group) => this.residents.add(group),
        finish: (update) => this.finish(update),
      });
      hasMoved = this.residents.compact();
    } catch (error) {
      const noMemory = memoryError(error);
      if (!noMemory) throw error;
      this.onError?.(noMemory);
    }
    if (hasMoved || !this.updates.isEmpty) this.onChange?.();
    this.pauseIfBusy();
    if (count > 0 && this.tintFunction) this.paint();
  }

  /** Lets the stream rest while more groups wait than a few frames can upload. */
  private pauseIfBusy(): void {
    const isPaused = this.updates.waitingBytes > MAX_WAITING_BYTES;
    if (isPaused !== this.isPaused) this.stream.setPaused(isPaused);
    this.isPaused = isPaused;
  }

  /** Of an update whose groups are uploaded. */
  private finish(update: StreamUpdate): void {
    for (const group of update.removed) this.residents.remove(group);
    this.statistics = update.statistics;
    for (let i = 0; i < update.pages.length; i += 2) {
      const [page, state] = [update.pages[i] as number, update.pages[i + 1] as number];
      if (state === 0) this.pages.delete(page);
      else this.pages.set(page, state);
    }
    if (update.rows) this.place(update.rows);
    if (!update.cuts) return;
    const groupOf = this.residents.byCluster;
    update.cuts.forEach((cut, i) => {
      this.instances[i]?.setCut(cut, groupOf);
    });
    ++this.cutVersion;
  }

  /** Shows other instances of a tree. */
  private place(rows: readonly InstanceRow[]): void {
    const before = this.placed;
    this.placed = new Map();
    this.instances = rows.map((row, number) => {
      const same = before.get(row.key);
      before.delete(row.key);
      if (same instanceof InstancedCut) same.setRow(row);
      const instance = same ?? this.instanceOf(row, number);
      this.placed.set(row.key, instance);
      return instance;
    });
    for (const instance of before.values()) instance.dispose();
  }

  private boundsOf(mesh: number): Box3 {
    const { low, high } = this.info.meshes[mesh] as MeshInfo;
    return new Box3(new Vector3(...low), new Vector3(...high));
  }

  private instanceOf(row: InstanceRow, number: number): MeshInstance {
    if (row.count > 1 || !row.isOwn)
      return new InstancedCut(row, number, this, this.materials, this.box);
    const instance = new MeshInstance(
      { mesh: row.mesh, matrix: new Float32Array(12) },
      number,
      this,
      this.materials,
      this.boundsOf(row.mesh),
    );
    instance.matrix.fromArray(row.matrices);
    return instance;
  }

  /** Lists the visible part of the cuts for the GPU, and counts it. */
  private cullAndCount(camera: Camera): void {
    const { drawn } = this;
    drawn.calls = drawn.triangles = drawn.clusters = 0;
    for (const instance of this.instances)
      instance.updateRanges(frustumOf(camera, instance.worldMatrix()), this.lineMaterial, drawn);
  }

  private paint(): void {
    if (this.tintFunction) this.tint.paint(this.clusters(), this.residents, this.tintFunction);
    else this.tint.clear();
  }
}

function checkedOptions(options: UmbelMeshOptions): { pixelError: number; offscreen: number } {
  const pixelError = options.pixelError ?? 1;
  const offscreen = options.offscreen ?? 4;
  checkNumber("pixelError", pixelError, false);
  checkNumber("offscreen", offscreen, false);
  return { pixelError, offscreen };
}
