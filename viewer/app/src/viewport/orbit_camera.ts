// The camera and its controls. Poses are in the world, as in links and saved paths; the scene's zero
// is at the first asset's origin.

import { MOUSE, PerspectiveCamera, TOUCH, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { UmbelMesh } from "umbel/three";
import type { CameraPose } from "../state";
import { boundingSphereOf, depthsOf, FIELD_OF_VIEW, homePose, scaled, translated } from "./camera";

/** Whether the camera moves on for a moment after a drag. */
const HAS_DAMPING = !matchMedia("(prefers-reduced-motion: reduce)").matches;

export class OrbitCamera {
  readonly perspective = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
  /** Position of the scene's zero in the world. */
  origin: readonly [number, number, number] = [0, 0, 0];
  /** Lengths in the scene for each in the world. */
  unit = 1;
  private readonly controls: OrbitControls;
  private home: Vector3 | undefined;

  constructor(
    canvas: HTMLCanvasElement,
    private readonly onChange: () => void,
  ) {
    this.controls = new OrbitControls(this.perspective, canvas);
    this.controls.enableDamping = HAS_DAMPING;
    this.controls.dampingFactor = 0.18;
    this.controls.zoomToCursor = true;
    this.controls.mouseButtons = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    this.controls.touches = { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN };
    this.controls.addEventListener("change", onChange);
  }

  /** The point that the camera orbits, in the scene. */
  get target(): Vector3 {
    return this.controls.target;
  }

  get pose(): CameraPose {
    const pose = {
      position: this.perspective.position.toArray(),
      target: this.controls.target.toArray(),
    };
    return translated(scaled(pose, 1 / this.unit), this.origin, 1);
  }

  setPose(pose: CameraPose): void {
    const { position, target } = scaled(translated(pose, this.origin, -1), this.unit);
    this.perspective.position.set(...position);
    this.controls.target.set(...target);
    // An update without damping also ends the current movement.
    this.controls.enableDamping = false;
    this.controls.update();
    this.controls.enableDamping = HAS_DAMPING;
    this.onChange();
  }

  /**
   * Shows the whole of a mesh; `aspect` is the picture's width over height. Does nothing if the camera
   * would move by no more than `least` of its distance.
   */
  frame(mesh: UmbelMesh, aspect: number, least = 0): void {
    const { min, max } = mesh.shownBox();
    const pose = homePose({ low: min.toArray(), high: max.toArray() }, aspect);
    const { position } = this.perspective;
    const move = position.distanceTo(new Vector3(...scaled(pose, this.unit).position));
    if (least > 0 && move <= least * position.distanceTo(this.target)) return;
    this.setPose(translated(pose, this.origin, 1));
    this.home = position.clone();
  }

  /** Whether the camera is where `frame` put it, up to the rounding of its controls. */
  get isHome(): boolean {
    const { position } = this.perspective;
    if (!this.home) return false;
    return position.distanceTo(this.home) <= 1e-9 * position.distanceTo(this.target);
  }

  /** Moves camera and target by parts of their distance, along the camera's axes. */
  fly(right: number, up: number, forward: number): void {
    const { position, quaternion } = this.perspective;
    const move = new Vector3(right, up, -forward)
      .multiplyScalar(position.distanceTo(this.controls.target))
      .applyQuaternion(quaternion);
    position.add(move);
    this.controls.target.add(move);
    this.onChange();
  }

  /** Applies input and damping; whether the camera has moved. */
  update(): boolean {
    return this.controls.update();
  }

  /** Fits the depth range and the zoom limits to a mesh. */
  fitTo(mesh: UmbelMesh): void {
    const { center, radius: meshRadius } = boundingSphereOf(mesh.info);
    const radius = meshRadius * this.unit;
    const middle = new Vector3(...center).multiplyScalar(this.unit).add(mesh.position);
    const distance = this.perspective.position.distanceTo(middle);
    Object.assign(this.perspective, depthsOf(distance, radius));
    this.perspective.updateProjectionMatrix();
    this.controls.minDistance = radius * 1e-3;
    this.controls.maxDistance = radius * 50;
  }
}
