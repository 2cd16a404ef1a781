// The canvas: draws one or two assets, whenever something has changed.

import {
  Color,
  LineBasicMaterial,
  type Material,
  MeshPhysicalMaterial,
  Raycaster,
  Scene,
  Vector2,
  WebGLRenderer,
} from "three";
import type { ClusterInfo, UmbelIntersection, UmbelMesh } from "umbel/three";
import { MAX_PIXEL_RATIO, type State } from "../state";
import { Background } from "./background";
import { sceneUnit } from "./camera";
import { ClusterBoxes } from "./cluster_boxes";
import { makeEnvironment } from "./environment";
import { dividerAt, type Pane, panesOf } from "./layout";
import { LightRig } from "./light_rig";
import { OrbitCamera } from "./orbit_camera";
import { TextureWait } from "./texture_wait";
import { tintOf } from "./view_modes";

/** Left and right; the right one is for comparison. */
export type Meshes = readonly [UmbelMesh | undefined, UmbelMesh | undefined];

/** Of all meshes. */
export interface FrameCounts {
  triangles: number;
  clusters: number;
  draws: number;
  /** Milliseconds since the frame before; 0 if nothing moved then. */
  interval: number;
  /** Milliseconds of the page's thread for this frame, and for the mesh's update alone. */
  work: number;
  updateWork: number;
}

export interface PickedCluster {
  mesh: UmbelMesh;
  cluster: ClusterInfo;
  /** In the world, as the point. */
  distance: number;
  point: number[];
}

/** Move of the camera that is worth its while when the asset's size is known better. */
const HOME_STEP = 0.01;

export class Viewport {
  readonly canvas: HTMLCanvasElement;
  readonly camera: OrbitCamera;
  /** Left and right; the right one is for comparison. */
  meshes: [UmbelMesh | undefined, UmbelMesh | undefined] = [undefined, undefined];
  /** The picked cluster, which is highlighted, by its number. */
  picked: { mesh: UmbelMesh; cluster: number } | undefined;
  /** Whether the right mesh has the pixel error of the left one; otherwise it is exact. */
  rightFollows = false;
  onFrame: ((counts: FrameCounts) => void) | undefined;
  /** Called when other meshes are shown. */
  onMeshes: ((meshes: Meshes) => void) | undefined;
  /** Called when the browser takes the GPU away, and when it gives it back. */
  onContext: ((isLost: boolean) => void) | undefined;
  /** Moves the camera before each frame; returns whether it does. */
  beforeFrame: ((time: number) => boolean) | undefined;

  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly lights = new LightRig(this.scene);
  private readonly boxes = new ClusterBoxes(this.scene);
  private readonly background = new Background(this.scene);
  private readonly lineMaterial = new LineBasicMaterial({ transparent: true, opacity: 0.55 });
  private readonly textureWait = new TextureWait();
  /** The cut that the whole asset was shown by; undefined when that is known well enough. */
  private framedCut: number | undefined;
  /** That of the screen, which the canvas has where it is not too large. */
  private pixelRatio = 0;
  private isRequested = false;
  private lastFrame = 0;
  private wasMoving = false;

  constructor(
    private readonly host: HTMLElement,
    private readonly state: State,
  ) {
    this.renderer = new WebGLRenderer({
      antialias: true,
      alpha: true,
      preserveDrawingBuffer: false,
    });
    this.renderer.setClearAlpha(0);
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("aria-label", "The model. Drag to turn, scroll to come closer.");
    host.append(this.canvas);
    this.scene.environment = makeEnvironment();
    this.camera = new OrbitCamera(this.canvas, () => this.requestFrame());
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
    this.watchPixelRatio();
    this.canvas.addEventListener("webglcontextlost", () => this.onContext?.(true));
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.scene.environment = makeEnvironment();
      this.resize();
      this.requestFrame();
      this.onContext?.(false);
    });
  }

  /** Another screen may have another pixel ratio, with the same size of the page. */
  private watchPixelRatio(): void {
    const current = matchMedia(`(resolution: ${devicePixelRatio}dppx)`);
    const change = () => {
      this.requestFrame();
      this.watchPixelRatio();
    };
    current.addEventListener("change", change, { once: true });
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (!width || !height) return;
    this.pixelRatio = pixelRatio();
    this.renderer.setPixelRatio(this.pixelRatio);
    this.renderer.setSize(width, height, false);
    this.fitBuffer();
    this.background.paint(width, height);
    this.requestFrame();
  }

  /** Browsers give large canvases fewer pixels than they ask for: asks for as many as there are. */
  private fitBuffer(): void {
    const { drawingBufferWidth, drawingBufferHeight } = this.renderer.getContext();
    const { width, height } = this.canvas;
    const part = Math.min(drawingBufferWidth / width, drawingBufferHeight / height);
    if (part > 0 && part < 1) this.renderer.setPixelRatio(part * this.pixelRatio);
  }

  /** Width and height in pixels of the page. */
  private get size(): [number, number] {
    return this.renderer.getSize(new Vector2()).toArray();
  }

  /** Height in pixels of the canvas. */
  get height(): number {
    return this.renderer.getDrawingBufferSize(new Vector2()).y;
  }

  setMesh(side: 0 | 1, mesh: UmbelMesh | undefined): void {
    this.meshes[side]?.dispose();
    this.background.reset();
    this.meshes[side] = mesh;
    if (mesh) {
      this.textureWait.start(() => this.requestFrame());
      mesh.onChange = () => this.requestFrame();
      this.scene.add(mesh);
    }
    if (side === 0) this.framedCut = -1;
    // The scene's zero is that of the first asset, so drawn coordinates are small, and so is its unit.
    const [first] = this.meshes;
    this.camera.origin = first?.origin ?? [0, 0, 0];
    this.camera.unit = first ? sceneUnit(first.info) : 1;
    for (const each of this.meshes) {
      each?.setSceneOrigin(this.camera.origin);
      each?.position.multiplyScalar(this.camera.unit);
      each?.scale.setScalar(this.camera.unit);
    }
    this.onMeshes?.(this.meshes);
    this.apply();
  }

  /** Applies the settings to the meshes. */
  apply(): void {
    const { viewMode, wireframe, frozen } = this.state;
    const isDark = document.documentElement.dataset.theme === "dark";
    this.lineMaterial.color = new Color(isDark ? 0x0b0d10 : 0x1c2127);
    for (const mesh of this.meshes) {
      if (!mesh) continue;
      const picked = this.picked?.mesh === mesh ? this.picked.cluster : undefined;
      mesh.setTint(tintOf(viewMode, mesh, picked));
      mesh.setLines(wireframe ? this.lineMaterial : undefined);
      mesh.isFrozen = frozen;
      mesh.onMaterial = (material) => this.prepare(material);
      for (const material of mesh.materials.all) this.prepare(material);
    }
    this.background.paint(...this.size);
    this.setPixelErrors();
    this.boxes.invalidate();
    this.requestFrame();
  }

  private setPixelErrors(): void {
    this.meshes.forEach((mesh, side) => {
      if (!mesh || (side === 1 && !this.rightFollows)) return;
      const pixels = this.textureWait.errorFactor(mesh) * this.state.pixelError;
      if (mesh.pixelError !== pixels) this.requestFrame();
      mesh.pixelError = pixels;
    });
  }

  private prepare(material: Material): void {
    const { wireframe } = this.state;
    // Offsets faces in depth, so that lines on them are visible.
    material.polygonOffset = wireframe;
    material.polygonOffsetFactor = 1;
    material.polygonOffsetUnits = 1;
    // The one length of materials in the scene's unit.
    if (material instanceof MeshPhysicalMaterial) {
      material.userData.attenuationDistance ??= material.attenuationDistance;
      material.attenuationDistance = material.userData.attenuationDistance * this.camera.unit;
    }
    this.background.prepare(material, ...this.size);
  }

  /** Moves the camera to show the whole asset, if it moves by more than `least` of its distance. */
  frameAll(least = 0): void {
    const mesh = this.meshes[0];
    if (!mesh) return;
    const [width, height] = this.size;
    const panes = this.state.layout === "side" ? 2 : 1;
    this.camera.frame(mesh, width / panes / height, least);
  }

  /** Coarse clusters may stick out of an asset, so its size is known only as finer ones arrive. */
  private refineHome(): void {
    const mesh = this.meshes[0];
    if (!mesh || this.framedCut === undefined) return;
    if (this.camera.isHome && this.framedCut !== mesh.cutVersion) this.frameAll(HOME_STEP);
    const isFine = this.textureWait.errorFactor(mesh) === 1 && mesh.isCutSettled;
    const isOver = isFine || !this.camera.isHome;
    this.framedCut = isOver ? undefined : mesh.cutVersion;
  }

  /** Requests a frame, once. */
  requestFrame(): void {
    if (this.isRequested) return;
    this.isRequested = true;
    requestAnimationFrame((time) => {
      this.isRequested = false;
      this.frame(time);
    });
  }

  private frame(time: number): void {
    const start = performance.now();
    if (this.pixelRatio !== pixelRatio()) this.resize();
    const interval = this.wasMoving && this.lastFrame ? time - this.lastFrame : 0;
    this.lastFrame = time;
    const isDriven = this.beforeFrame?.(time) ?? false;
    const isDamping = this.camera.update();
    this.wasMoving = isDriven || isDamping;
    if (this.wasMoving) this.requestFrame();
    this.draw();
    this.refineHome();
    this.setPixelErrors();
    const sum = (of: (mesh: UmbelMesh) => number) =>
      this.meshes.reduce((total, mesh) => total + (mesh ? of(mesh) : 0), 0);
    this.onFrame?.({
      triangles: sum(({ drawn }) => drawn.triangles),
      clusters: sum(({ drawn }) => drawn.clusters),
      draws: sum(({ drawn }) => drawn.calls),
      interval,
      work: performance.now() - start,
      updateWork: sum(({ updateTime }) => updateTime),
    });
  }

  private draw(): void {
    const { renderer } = this;
    const [width, height] = this.size;
    const [left, right] = this.meshes;
    const { layout, wipe } = this.state;
    renderer.setScissorTest(false);
    renderer.clear();
    if (layout === "single" || !right) {
      const whole = [0, 0, width, height] as const;
      this.drawMesh(left, { viewport: whole, scissor: whole });
      return;
    }
    renderer.setScissorTest(true);
    const [leftPane, rightPane] = panesOf(layout, wipe, width, height);
    this.drawMesh(left, leftPane);
    this.drawMesh(right, rightPane);
  }

  private drawMesh(mesh: UmbelMesh | undefined, { viewport, scissor }: Pane): void {
    const { camera, renderer } = this;
    renderer.setViewport(...viewport);
    renderer.setScissor(...scissor);
    camera.perspective.aspect = viewport[2] / Math.max(viewport[3], 1);
    this.lights.follow(camera);
    for (const each of this.meshes) if (each) each.visible = each === mesh;
    if (mesh) {
      camera.fitTo(mesh);
      mesh.update(camera.perspective, renderer);
      if (this.state.viewMode === "overlap") this.boxes.show(mesh);
      else this.boxes.hide();
    }
    renderer.render(this.scene, camera.perspective);
  }

  /** The side of the dividing line that a position from the left of the page is on. */
  sideOf(x: number): 0 | 1 {
    const { left, width } = this.canvas.getBoundingClientRect();
    const { layout, wipe } = this.state;
    return layout !== "single" && (x - left) / width > dividerAt(layout, wipe) ? 1 : 0;
  }

  /** Picks the cluster at a point of the page. */
  pick(x: number, y: number): PickedCluster | undefined {
    const rectangle = this.canvas.getBoundingClientRect();
    let u = (x - rectangle.left) / rectangle.width;
    const v = (y - rectangle.top) / rectangle.height;
    const { perspective, origin, unit } = this.camera;
    let [mesh] = this.meshes;
    perspective.aspect = rectangle.width / rectangle.height;
    if (this.meshes[1]) {
      mesh = this.meshes[this.sideOf(x)];
      if (this.state.layout === "side") {
        u = (2 * u) % 1;
        perspective.aspect /= 2;
      }
    }
    if (!mesh) return undefined;
    perspective.updateProjectionMatrix();
    const raycaster = new Raycaster();
    raycaster.setFromCamera(new Vector2(2 * u - 1, 1 - 2 * v), perspective);
    const [nearest] = raycaster.intersectObject(mesh, false) as UmbelIntersection[];
    if (!nearest) return undefined;
    const point = nearest.point.toArray().map((at, i) => at / unit + (origin[i] as number));
    return { mesh, cluster: nearest.cluster, distance: nearest.distance / unit, point };
  }

  /** The current picture on a background, as PNG. */
  async picture(paintBackground: (context: CanvasRenderingContext2D) => void): Promise<Blob> {
    this.draw();
    const copy = document.createElement("canvas");
    copy.width = this.canvas.width;
    copy.height = this.canvas.height;
    const context = copy.getContext("2d") as CanvasRenderingContext2D;
    paintBackground(context);
    context.drawImage(this.canvas, 0, 0);
    return new Promise((resolve, reject) => {
      copy.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png");
    });
  }
}

/** Pixels of the canvas for each pixel of the page. */
function pixelRatio(): number {
  return Math.min(devicePixelRatio, MAX_PIXEL_RATIO);
}
