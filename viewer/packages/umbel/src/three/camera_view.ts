// Converts a camera of three.js into a view for selection, in an object's coordinates.

import { type Camera, Frustum, Matrix4, Vector3 } from "three";
import { cameraView, type View } from "../select/select.js";
import type { SceneView } from "../stream/instance_stream.js";

/** The matrix of three rows of four. */
export function matrixOf(rows: Float32Array): Matrix4 {
  return new Matrix4().fromArray([...rows, 0, 0, 0, 1]).transpose();
}

export function frustumOf(camera: Camera, world: Matrix4): Frustum {
  const matrix = new Matrix4()
    .multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse)
    .multiply(world);
  return new Frustum().setFromProjectionMatrix(matrix);
}

export interface CameraSettings {
  camera: Camera;
  /** Of the picture, in pixels of the canvas. */
  height: number;
  pixelError: number;
  /** Factor on `pixelError` outside of the view volume. */
  offscreen: number;
}

/** The view of a camera, in the object's coordinates. */
export function viewOf(
  { camera, height, pixelError, offscreen }: CameraSettings,
  world: Matrix4,
): View {
  const [low, high] = scalesOf(world);
  const sides = frustumOf(camera, world).planes.slice(0, 4);
  const planes = Float32Array.from(
    sides.flatMap(({ normal, constant }) => [normal.x, normal.y, normal.z, constant]),
  );
  if (isOrthographic(camera)) {
    const error = (pixelError * heightOf(camera)) / (height * high);
    return { kind: "error", error, planes, offscreen };
  }
  const eye = cameraPosition(camera, world);
  // Errors grow at most with the longest axis; distances grow at least with the shortest.
  const view = cameraView(
    [eye.x, eye.y, eye.z],
    2 * Math.atan(heightOf(camera) / 2),
    height,
    (pixelError * low) / high,
  );
  return { ...view, planes, offscreen };
}

/** Factor on the width and the height of a scene's view, for what a turn of the camera brings. */
const SCENE_MARGIN = 1.25;

/** The view of a camera for a tree of instances, in the object's coordinates. */
export function sceneViewOf(settings: CameraSettings, world: Matrix4): SceneView {
  const { camera } = settings;
  // About the middle of the picture, which the camera need not look at.
  const wide = new Matrix4().makeScale(1 / SCENE_MARGIN, 1 / SCENE_MARGIN, 1);
  const matrix = wide
    .multiply(camera.projectionMatrix)
    .multiply(camera.matrixWorldInverse)
    .multiply(world);
  const sides = new Frustum().setFromProjectionMatrix(matrix).planes.slice(0, 4);
  const planes = Float32Array.from(
    sides.flatMap(({ normal, constant }) => [normal.x, normal.y, normal.z, constant]),
  );
  return { view: viewOf(settings, world), planes };
}

/** The pose of a camera and an object, as groups of numbers of like size. */
export function poseOf(camera: Camera, object: Matrix4): number[][] {
  const matrices = [camera.matrixWorld, camera.projectionMatrix, object];
  return matrices.flatMap(({ elements }) => [elements.slice(0, 12), elements.slice(12)]);
}

/** Whether two poses are equal up to rounding: camera controls are not exact at rest. */
export function isSamePose(a: readonly number[][], b: readonly number[][]): boolean {
  return a.every((row, i) => {
    const max = row.reduce((sum, x) => Math.max(sum, Math.abs(x)), 0);
    return row.every((x, j) => Math.abs(x - (b[i]?.[j] ?? Infinity)) <= 1e-12 * max);
  });
}

/** Returns the pixels of a unit of the object, as a function of the distance in its units. */
export function pixelsPerUnit(
  camera: Camera,
  world: Matrix4,
  height: number,
): (distance: number) => number {
  const atOne = height / heightOf(camera);
  if (!isOrthographic(camera)) return (distance) => atOne / distance;
  const pixels = scalesOf(world)[1] * atOne;
  return () => pixels;
}

/** The position of a camera in an object's coordinates. */
export function cameraPosition(camera: Camera, world: Matrix4): Vector3 {
  return new Vector3()
    .setFromMatrixPosition(camera.matrixWorld)
    .applyMatrix4(world.clone().invert());
}

function isOrthographic({ projectionMatrix }: Camera): boolean {
  return projectionMatrix.elements[11] === 0;
}

/** The height of what an orthographic camera shows, or a perspective one at a distance of 1. */
function heightOf({ projectionMatrix }: Camera): number {
  return 2 / Math.abs(projectionMatrix.elements[5]);
}

/**
 * The least and the greatest factor on lengths; exact where the axes stay at right angles, otherwise
 * bounds (Gershgorin's circles of the matrix of the columns' products, and the determinant).
 */
function scalesOf(world: Matrix4): [number, number] {
  const columns = [0, 1, 2].map((i) => new Vector3().setFromMatrixColumn(world, i));
  let [low, high] = [Infinity, 0];
  for (const column of columns) {
    const squared = column.lengthSq();
    const others = columns.reduce((sum, other) => sum + Math.abs(column.dot(other)), 0) - squared;
    low = Math.min(low, squared - others);
    high = Math.max(high, squared + others);
  }
  const least = Math.abs(world.determinant()) / Math.max(high, Number.MIN_VALUE);
  return [Math.max(Math.sqrt(Math.max(low, 0)), least), Math.sqrt(high)];
}
