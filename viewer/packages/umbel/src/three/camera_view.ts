// What a camera of three.js sees of an object, as selection takes it.

import {
  type Camera,
  Frustum,
  Matrix4,
  type OrthographicCamera,
  type PerspectiveCamera,
  Vector3,
} from "three";
import { cameraView, type View } from "../select/select.js";

/** Of three rows of four. */
export function matrixOf(rows: Float32Array): Matrix4 {
  return new Matrix4().fromArray([...rows, 0, 0, 0, 1]).transpose();
}

export function frustumOf(camera: Camera, world: Matrix4): Frustum {
  const matrix = new Matrix4()
    .multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse)
    .multiply(world);
  return new Frustum().setFromProjectionMatrix(matrix);
}

export interface Seeing {
  camera: Camera;
  /** Of the picture, in pixels of the screen. */
  height: number;
  pixelError: number;
  /** How many times that where the camera does not look. */
  offscreen: number;
}

/** What selection needs of a camera, in the object's own coordinates. */
export function viewOf({ camera, height, pixelError, offscreen }: Seeing, world: Matrix4): View {
  const [low, high] = scalesOf(world);
  if ((camera as OrthographicCamera).isOrthographicCamera) {
    const { top, bottom, zoom } = camera as OrthographicCamera;
    return { kind: "error", error: (pixelError * (top - bottom)) / (zoom * height * high) };
  }
  const eye = eyeOf(camera, world);
  // Where an axis is stretched, errors grow most with the longest and distances least.
  const view = cameraView(
    [eye.x, eye.y, eye.z],
    fieldOfView(camera),
    height,
    (pixelError * low) / high,
  );
  const sides = frustumOf(camera, world).planes.slice(0, 4);
  view.planes = Float32Array.from(
    sides.flatMap(({ normal, constant }) => [normal.x, normal.y, normal.z, constant]),
  );
  view.offscreen = offscreen;
  return view;
}

/** A camera and an object, as numbers that belong together: to tell whether either has moved. */
export function posesOf(camera: Camera, object: Matrix4): number[][] {
  const matrices = [camera.matrixWorld, camera.projectionMatrix, object];
  return matrices.flatMap(({ elements }) => [elements.slice(0, 12), elements.slice(12)]);
}

/** Whether they are the same but for rounding: controls may tremble at rest. */
export function areSamePoses(a: readonly number[][], b: readonly number[][]): boolean {
  return a.every((row, i) => {
    const most = row.reduce((sum, x) => Math.max(sum, Math.abs(x)), 0);
    return row.every((x, j) => Math.abs(x - (b[i]?.[j] ?? Infinity)) <= 1e-12 * most);
  });
}

/** Tells how many pixels a unit of the object is long, at a distance in its own units. */
export function pixelsPerUnit(
  camera: Camera,
  world: Matrix4,
  height: number,
): (distance: number) => number {
  if ((camera as OrthographicCamera).isOrthographicCamera) {
    const { top, bottom, zoom } = camera as OrthographicCamera;
    const pixels = (scalesOf(world)[1] * zoom * height) / (top - bottom);
    return () => pixels;
  }
  const atOne = height / (2 * Math.tan(fieldOfView(camera) / 2));
  return (distance) => atOne / distance;
}

/** Where a camera is, in an object's own coordinates. */
export function eyeOf(camera: Camera, world: Matrix4): Vector3 {
  return new Vector3()
    .setFromMatrixPosition(camera.matrixWorld)
    .applyMatrix4(world.clone().invert());
}

function fieldOfView(camera: Camera): number {
  return ((camera as PerspectiveCamera).getEffectiveFOV() * Math.PI) / 180;
}

/** By how much an object's shortest and longest axis are stretched. */
function scalesOf(world: Matrix4): [number, number] {
  const scale = new Vector3().setFromMatrixScale(world);
  return [Math.min(...scale), Math.max(...scale)];
}
