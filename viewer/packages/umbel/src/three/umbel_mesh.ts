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
import { boundsOf } from "../stream/bounds.js";
import type { AssetInfo, StreamStatistics, StreamUpdate } from "../stream/streamer.js";
import { AssetStream } from "../worker/asset_stream.js";
import { areSamePoses, frustumOf, posesOf, viewOf } from "./camera_view.js";
import type { ClusterInfo, TintFunction } from "./cluster_info.js";
import { Tint } from "./cluster_tint.js";
import { type Resident, Residents } from "./geometry/resident_groups.js";
import { type Drawn, Instance } from "./instance.js";
import { Materials } from "./materials/materials.js";
import { notesOf } from "./materials/unsupported.js";
import { castRay } from "./raycast.js";
import { Survey } from "./textures/texel_demand.js";
import type { TextureStatistics } from "./textures/textures.js";

export interface UmbelMeshOptions {
  /** Bytes of memory for geometry and textures; 256 MiB if not said. */
  budget?: number;
  /** How many pixels what is drawn may be from the full mesh; 1 if not said. */
  pixelError?: number;
  /** How many times that where the camera does not look; 4 if not said. */
  offscreen?: number;
  /** Folder of basis_transcoder.js and .wasm, for KTX2; if not said, where three.js has them. */
  basisPath?: string;
}

/** Time to bring new groups to the GPU in a frame, in milliseconds. */
const UPLOAD_TIME = 6;
const DEFAULT_BUDGET = 2 ** 28;
/** Of the budget, what textures may take, and what is left to geometry whatever they take. */
const TEXTURE_SHARE = 0.5;
const LEAST_SHARE = 0.25;

export class UmbelMesh extends Object3D {
  /** Pixels that what is drawn may be from the full mesh. */
  pixelError: number;
  /** While true, what is drawn stays as it is, wherever the camera goes. */
  isFrozen = false;
  statistics: StreamStatistics | undefined;
  /** For each page, in the order of the file: 0 absent, 1 loading, 2 resident, 3 damaged. */
  pages: Uint8Array = new Uint8Array(0);
  /** Draw calls, triangles and clusters of the last frame, after culling. */
  readonly drawn: Drawn = { calls: 0, triangles: 0, clusters: 0 };
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

  private readonly instances: Instance[];
  private readonly residents: Residents;
  private readonly survey = new Survey();
  private readonly offscreen: number;
  private readonly queue: StreamUpdate[] = [];
  private readonly tint = new Tint();
  private tintFunction: TintFunction | undefined;
  private lineMaterial: Material | undefined;
  private lastView: number[][] = [];
  /** Rises whenever the camera has moved. */
  private viewVersion = 0;
  private budget: number;
  private textureBytes = 0;

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
    this.budget = stream.budget;
    const { low, high } = boundsOf(stream.info);
    this.box = new Box3(new Vector3(...low), new Vector3(...high));
    this.materials = new Materials(
      stream,
      options.basisPath ?? "",
      (material) => {
        this.tint.applyTo(material);
        this.onMaterial?.(material);
      },
      () => this.onTexture(),
    );
    this.materials.textures.limit = TEXTURE_SHARE * this.budget;
    for (const text of notesOf(stream.info)) this.materials.note(text);
    this.residents = new Residents(
      stream.info.meshes,
      (slots) => this.tint.reserve(slots),
      (arena) => {
        for (const instance of this.instances) instance.removeArena(arena);
      },
    );
    this.instances = stream.info.instances.map(
      (row, number) => new Instance(row, number, this, this.materials),
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

  /** Where the object's zero is in the asset's world, in binary64. */
  get origin(): readonly [number, number, number] {
    return this.stream.info.origin;
  }

  /**
   * Moves the object to where it is in a scene whose zero stands for `common` of the asset's world,
   * so that assets with different origins stand where they belong to each other.
   */
  placeFrom(common: readonly [number, number, number]): void {
    const [x, y, z] = this.origin;
    this.position.set(x - common[0], y - common[1], z - common[2]);
  }

  /** The greatest error that is not infinite, of what has arrived. */
  get coarsestError(): number {
    return this.residents.coarsestError;
  }

  /** What of the textures is here; `statistics` are of the geometry. */
  get textures(): TextureStatistics {
    const { isComplete, ...counts } = this.materials.textures.statistics;
    const isSeen = this.survey.isDone && this.drawn.triangles > 0;
    return { ...counts, isComplete: isComplete && (isSeen || !this.materials.textures.hasAny) };
  }

  /** Whether nothing is on its way: neither geometry nor textures that are wanted. */
  get isSettled(): boolean {
    const isHere = this.queue.length === 0 && this.statistics?.isSettled === true;
    return isHere && this.survey.isDone && this.materials.textures.statistics.missing === 0;
  }

  setBudget(bytes: number): void {
    this.budget = bytes;
    this.materials.textures.limit = TEXTURE_SHARE * bytes;
    this.survey.isDone = false;
    this.shareBudget();
  }

  /** Geometry may take what textures leave. */
  private shareBudget(): void {
    this.textureBytes = this.textures.bytes;
    this.stream.setBudget(Math.max(this.budget - this.textureBytes, LEAST_SHARE * this.budget));
  }

  private onTexture(): void {
    if (this.textures.bytes !== this.textureBytes) this.shareBudget();
    this.onChange?.();
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
    for (const instance of this.instances) instance.removeLines();
  }

  /** Frees all memory; the object is of no use after that. */
  override dispose(): void {
    this.stream.close();
    this.removeFromParent();
    this.clear();
    this.residents.dispose();
    this.materials.dispose();
    this.tint.dispose();
    this.queue.length = 0;
  }

  /** To be called before each frame: takes what has arrived, asks for what is seen. */
  update(camera: Camera, renderer: WebGLRenderer): void {
    const start = performance.now();
    this.updateWorldMatrix(true, false);
    camera.updateWorldMatrix(true, false);
    this.receiveQueued(start);
    const { y: height } = renderer.getDrawingBufferSize(new Vector2());
    if (!this.isFrozen) this.look(camera, height);
    this.makeRanges(camera);
    this.survey.update(this.instances, camera, height, `${this.viewVersion} ${this.cutVersion}`, {
      see: (seen) => this.materials.textures.see(seen, renderer),
      // What was seen while the camera moved is surveyed once more when it rests.
      again: () => this.onChange?.(),
    });
    if (this.drawn.triangles > 0 && this.survey.isDone) this.materials.textures.beginFrame();
    this.updateTime = performance.now() - start;
  }

  /** The clusters that are drawn, culled ones too; of every instance. */
  *clusters(): Generator<ClusterInfo> {
    for (const instance of this.instances) yield* instance.clusters();
  }

  override raycast(raycaster: Raycaster, intersections: Intersection[]): void {
    castRay(this, this.instances, this.residents, raycaster, intersections);
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
    for (const group of update.removed) this.residents.remove(group);
    for (const group of update.added) this.residents.add(group);
    this.statistics = update.statistics;
    this.pages = update.pages;
    if (!update.cuts) return;
    const groupOf = this.residents.byCluster();
    update.cuts.forEach((cut, i) => {
      this.instances[i]?.setCut(cut, groupOf);
    });
    ++this.cutVersion;
  }

  /** Tells the stream what the camera sees, if that has changed. */
  private look(camera: Camera, height: number): void {
    const view = [[height, this.pixelError], ...posesOf(camera, this.matrixWorld)];
    if (areSamePoses(view, this.lastView)) return;
    this.lastView = view;
    ++this.viewVersion;
    const seeing = { camera, height, pixelError: this.pixelError, offscreen: this.offscreen };
    this.stream.setViews(
      this.instances.map((instance) => ({
        mesh: instance.mesh,
        view: viewOf(seeing, instance.worldMatrix()),
      })),
    );
  }

  /** Lists what of the cuts is in view, for the GPU. */
  private makeRanges(camera: Camera): void {
    const { drawn } = this;
    drawn.calls = drawn.triangles = drawn.clusters = 0;
    for (const instance of this.instances)
      instance.makeRanges(frustumOf(camera, instance.worldMatrix()), this.lineMaterial, drawn);
  }

  private paint(): void {
    const { tintFunction } = this;
    if (!tintFunction) {
      this.tint.clear();
      return;
    }
    for (const info of this.clusters()) {
      const { place, group } = this.residents.get(info.group) as Resident;
      this.tint.set(place.slot + info.cluster - group.firstCluster, ...tintFunction(info));
    }
    this.tint.update();
  }
}
