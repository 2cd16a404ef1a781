// The canvas: renderer, light, camera and what moves it, and one or two assets side by side.

import {
  BoxGeometry,
  Color,
  DirectionalLight,
  InstancedMesh,
  LineBasicMaterial,
  type Material,
  Matrix4,
  MeshBasicMaterial,
  MOUSE,
  NormalBlending,
  PerspectiveCamera,
  Raycaster,
  Scene,
  TOUCH,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { ClusterInfo, UmbelIntersection, UmbelMesh } from "umbel/three";
import { type CameraPose, MAX_PIXEL_RATIO, type State } from "../state";
import { Backdrop } from "./background";
import { ballOf, depthsOf, FIELD_OF_VIEW, homePose, movedBy, UNDRESSED } from "./camera";
import { makeEnvironment } from "./environment";
import { FILL, KEY, type Lamp } from "./lights";
import { tintOf } from "./view_modes";

const BOX_OPACITY = 0.05;
/** Milliseconds that geometry waits for textures, at most. */
const PATIENCE = 4000;
/** Whether the camera glides on for a moment when a hand lets go. */
const GLIDES = !matchMedia("(prefers-reduced-motion: reduce)").matches;

export interface FrameCounts {
  triangles: number;
  clusters: number;
  draws: number;
  /** Milliseconds between this frame and the one before; 0 where nothing moved before. */
  interval: number;
  /** Milliseconds that the page's thread was busy with this frame. */
  work: number;
  updateWork: number;
}

export interface Picked {
  mesh: UmbelMesh;
  cluster: ClusterInfo;
  distance: number;
  /** In the world. */
  point: number[];
}

export class Stage {
  readonly canvas: HTMLCanvasElement;
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
  readonly controls: OrbitControls;
  /** Left and right; the right one is there to be compared with. */
  meshes: [UmbelMesh | undefined, UmbelMesh | undefined] = [undefined, undefined];
  onFrame: ((counts: FrameCounts) => void) | undefined;
  picked: number | undefined;
  /** Whether the right one has the same pixel error as the left, or none. */
  rightFollows = false;
  /** Asks for what moves the camera before each frame; true while it does. */
  beforeFrame: ((time: number) => boolean) | undefined;

  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly key = new DirectionalLight(KEY.color, KEY.intensity);
  private readonly fill = new DirectionalLight(FILL.color, FILL.intensity);
  private readonly lineMaterial = new LineBasicMaterial({ transparent: true, opacity: 0.55 });
  private readonly backdrop = new Backdrop(this.scene);
  private boxes: InstancedMesh | undefined;
  private home: Vector3 | undefined;
  /** Those whose materials in view all had their textures once. */
  private readonly dressed = new WeakSet<UmbelMesh>();
  private opened = 0;
  private isAsked = false;
  private lastFrame = 0;
  private wasMoving = false;
  private cutKey: unknown;

  constructor(
    host: HTMLElement,
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
    this.scene.add(this.key, this.key.target, this.fill, this.fill.target);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = GLIDES;
    this.controls.dampingFactor = 0.18;
    this.controls.zoomToCursor = true;
    this.controls.mouseButtons = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    this.controls.touches = { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN };
    this.controls.addEventListener("change", () => this.ask());
    new ResizeObserver(() => this.resize(host)).observe(host);
    this.resize(host);
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.scene.environment = makeEnvironment();
      this.ask();
    });
  }

  private resize(host: HTMLElement): void {
    const { clientWidth: width, clientHeight: height } = host;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, MAX_PIXEL_RATIO));
    this.renderer.setSize(width, height, false);
    this.backdrop.paint(width, height);
    this.ask();
  }

  /** Width and height in pixels of the page. */
  private get size(): [number, number] {
    return this.renderer.getSize(new Vector2()).toArray();
  }

  /** Height of the picture in pixels of the screen. */
  get height(): number {
    return this.renderer.getDrawingBufferSize(new Vector2()).y;
  }

  setMesh(side: 0 | 1, mesh: UmbelMesh | undefined): void {
    this.meshes[side]?.dispose();
    this.backdrop.reset();
    this.meshes[side] = mesh;
    if (mesh) {
      this.opened = performance.now();
      setTimeout(() => this.ask(), PATIENCE);
      mesh.onChange = () => this.ask();
      this.scene.add(mesh);
    }
    // The scene's zero is that of the first asset: what is drawn is near it.
    for (const each of this.meshes) each?.placeFrom(this.origin);
    this.apply();
  }

  /** Brings what is set to the meshes. */
  apply(): void {
    const { look, wireframe, frozen } = this.state;
    const isDark = document.documentElement.dataset.theme === "dark";
    this.lineMaterial.color = new Color(isDark ? 0x0b0d10 : 0x1c2127);
    for (const mesh of this.meshes) {
      if (!mesh) continue;
      mesh.setTint(tintOf(look, mesh, this.picked));
      mesh.setLines(wireframe ? this.lineMaterial : undefined);
      mesh.isFrozen = frozen;
      mesh.onMaterial = (material) => this.prepare(material);
      for (const material of mesh.materials.all) this.prepare(material);
    }
    this.backdrop.paint(...this.size);
    this.setPixelErrors();
    this.cutKey = undefined;
    this.ask();
  }

  private setPixelErrors(): void {
    this.meshes.forEach((mesh, side) => {
      if (!mesh || (side === 1 && !this.rightFollows)) return;
      if (mesh.textures.isComplete || performance.now() - this.opened > PATIENCE)
        this.dressed.add(mesh);
      const pixels = (this.dressed.has(mesh) ? 1 : UNDRESSED) * this.state.pixelError;
      if (mesh.pixelError !== pixels) this.ask();
      mesh.pixelError = pixels;
    });
  }

  private prepare(material: Material): void {
    const { wireframe } = this.state;
    // Moves faces back a little, so that lines on them are seen.
    material.polygonOffset = wireframe;
    material.polygonOffsetFactor = 1;
    material.polygonOffsetUnits = 1;
    this.backdrop.prepare(material, ...this.size);
  }

  /** Where the scene's zero is in the world. */
  get origin(): readonly [number, number, number] {
    return this.meshes[0]?.origin ?? [0, 0, 0];
  }

  /** Turns the camera to the whole of the asset. */
  frameAll(): void {
    const mesh = this.meshes[0];
    if (!mesh) return;
    const [width, height] = this.size;
    const parts = this.state.layout === "side" ? 2 : 1;
    this.setPose(movedBy(homePose(mesh.info, width / parts / height), this.origin, 1));
    this.home = this.camera.position.clone();
  }

  /** Whether the camera is where `frameAll` put it. */
  get isHome(): boolean {
    return this.home !== undefined && this.camera.position.distanceTo(this.home) === 0;
  }

  /** In the world, as poses are in links and in saved paths. */
  get pose(): CameraPose {
    const pose = {
      position: this.camera.position.toArray(),
      target: this.controls.target.toArray(),
    };
    return movedBy(pose, this.origin, 1);
  }

  setPose(pose: CameraPose): void {
    const { position, target } = movedBy(pose, this.origin, -1);
    this.camera.position.set(...position);
    this.controls.target.set(...target);
    // Without damping an update also ends what still turns.
    this.controls.enableDamping = false;
    this.controls.update();
    this.controls.enableDamping = GLIDES;
    this.ask();
  }

  /** Moves camera and target together, in the camera's directions and units of its distance. */
  fly(right: number, up: number, forward: number): void {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const move = new Vector3(right, up, -forward)
      .multiplyScalar(distance)
      .applyQuaternion(this.camera.quaternion);
    this.camera.position.add(move);
    this.controls.target.add(move);
    this.ask();
  }

  /** Draws a frame soon. */
  ask(): void {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame((time) => {
      this.isAsked = false;
      this.frame(time);
    });
  }

  private frame(time: number): void {
    const start = performance.now();
    const interval = this.wasMoving && this.lastFrame ? time - this.lastFrame : 0;
    this.lastFrame = time;
    const isDriven = this.beforeFrame?.(time) ?? false;
    const isDamping = this.controls.update();
    this.wasMoving = isDriven || isDamping;
    if (this.wasMoving) this.ask();
    this.draw();
    this.setPixelErrors();
    const [mesh] = this.meshes;
    this.onFrame?.({
      triangles: mesh?.drawn.triangles ?? 0,
      clusters: mesh?.drawn.clusters ?? 0,
      draws: mesh?.drawn.calls ?? 0,
      interval,
      work: performance.now() - start,
      updateWork: mesh?.updateTime ?? 0,
    });
  }

  private draw(): void {
    const { renderer } = this;
    const size = renderer.getSize(new Vector2());
    const [left, right] = this.meshes;
    const { layout, wipe } = this.state;
    renderer.setScissorTest(false);
    renderer.clear();
    if (layout === "single" || !right) {
      this.drawMesh(left, [0, 0, size.x, size.y], [0, 0, size.x, size.y]);
      return;
    }
    renderer.setScissorTest(true);
    const middle = Math.round(size.x * (layout === "side" ? 0.5 : wipe));
    const whole = [0, 0, size.x, size.y] as const;
    const parts = [
      [0, 0, middle, size.y],
      [middle, 0, size.x - middle, size.y],
    ] as const;
    this.drawMesh(left, layout === "side" ? parts[0] : whole, parts[0]);
    this.drawMesh(right, layout === "side" ? parts[1] : whole, parts[1]);
  }

  private drawMesh(
    mesh: UmbelMesh | undefined,
    viewport: readonly [number, number, number, number],
    scissor: readonly [number, number, number, number],
  ): void {
    const { camera, renderer } = this;
    renderer.setViewport(...viewport);
    renderer.setScissor(...scissor);
    camera.aspect = viewport[2] / Math.max(viewport[3], 1);
    this.placeLight();
    for (const each of this.meshes) if (each) each.visible = each === mesh;
    if (mesh) {
      this.setDepths(mesh);
      mesh.update(camera, renderer);
      this.updateBoxes(mesh);
    }
    renderer.render(this.scene, camera);
  }

  private setDepths(mesh: UmbelMesh): void {
    const { center, radius } = ballOf(mesh.info);
    const distance = this.camera.position.distanceTo(new Vector3(...center).add(mesh.position));
    Object.assign(this.camera, depthsOf(distance, radius));
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = radius * 1e-3;
    this.controls.maxDistance = radius * 50;
  }

  /** Lamps go with the viewer. */
  private placeLight(): void {
    const { camera, controls } = this;
    const at = controls.target;
    const place = (light: DirectionalLight, { from }: Lamp) => {
      light.target.position.copy(at);
      light.position
        .set(...from)
        .applyQuaternion(camera.quaternion)
        .add(at);
      light.target.updateMatrixWorld();
    };
    place(this.key, KEY);
    place(this.fill, FILL);
  }

  private updateBoxes(mesh: UmbelMesh): void {
    if (this.state.look !== "overlap") {
      if (this.boxes) this.boxes.visible = false;
      return;
    }
    const key = mesh.statistics && `${mesh.id} ${mesh.cutVersion}`;
    if (this.boxes && this.cutKey === key) {
      this.boxes.visible = true;
      return;
    }
    this.cutKey = key;
    const clusters = [...mesh.clusters()];
    if (this.boxes) {
      this.scene.remove(this.boxes);
      this.boxes.dispose();
    }
    const material = new MeshBasicMaterial({
      color: 0xf28c3a,
      transparent: true,
      opacity: BOX_OPACITY,
      depthTest: false,
      depthWrite: false,
      blending: NormalBlending,
    });
    this.boxes = new InstancedMesh(
      new BoxGeometry(1, 1, 1),
      material,
      Math.max(clusters.length, 1),
    );
    this.boxes.count = clusters.length;
    this.boxes.frustumCulled = false;
    const [size, middle, matrix] = [new Vector3(), new Vector3(), new Matrix4()];
    clusters.forEach(({ box, matrix: world }, i) => {
      box.getSize(size);
      box.getCenter(middle);
      matrix.makeScale(size.x, size.y, size.z).setPosition(middle).premultiply(world);
      matrix.premultiply(mesh.matrixWorld);
      this.boxes?.setMatrixAt(i, matrix);
    });
    this.scene.add(this.boxes);
  }

  /** The cluster at a place on the page, and the asset that it is of. */
  pick(x: number, y: number): Picked | undefined {
    const rectangle = this.canvas.getBoundingClientRect();
    let u = (x - rectangle.left) / rectangle.width;
    const v = (y - rectangle.top) / rectangle.height;
    const { layout, wipe } = this.state;
    let [mesh] = this.meshes;
    this.camera.aspect = rectangle.width / rectangle.height;
    if (layout !== "single" && this.meshes[1]) {
      if (u > (layout === "side" ? 0.5 : wipe)) mesh = this.meshes[1];
      if (layout === "side") {
        u = (2 * u) % 1;
        this.camera.aspect /= 2;
      }
    }
    if (!mesh) return undefined;
    this.camera.updateProjectionMatrix();
    const raycaster = new Raycaster();
    raycaster.setFromCamera(new Vector2(2 * u - 1, 1 - 2 * v), this.camera);
    const [nearest] = raycaster.intersectObject(mesh, false) as UmbelIntersection[];
    if (!nearest) return undefined;
    const point = nearest.point.toArray().map((at, i) => at + (this.origin[i] as number));
    return { mesh, cluster: nearest.cluster, distance: nearest.distance, point };
  }

  /** The picture as it is now, on its background. */
  async picture(background: (context: CanvasRenderingContext2D) => void): Promise<Blob> {
    this.draw();
    const copy = document.createElement("canvas");
    copy.width = this.canvas.width;
    copy.height = this.canvas.height;
    const context = copy.getContext("2d") as CanvasRenderingContext2D;
    background(context);
    context.drawImage(this.canvas, 0, 0);
    return new Promise((resolve, reject) => {
      copy.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png");
    });
  }
}
