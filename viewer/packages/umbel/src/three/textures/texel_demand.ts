// Which materials are in view, and how many texels of their textures could be told apart there.

import type { Camera } from "three";
import { eyeOf, frustumOf, pixelsPerUnit } from "../camera_view.js";
import type { Instance } from "../instance.js";

/** Milliseconds between two surveys while the camera moves. */
const INTERVAL = 150;
/** Nearer than this part of a group's size, all of its texels could be told apart. */
const NEAREST = 0.02;

export class Survey {
  /** Whether what is in view now has been surveyed. */
  isDone = false;
  private last = "";
  private lastTime = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;

  /**
   * Surveys what instances show, if that has changed and the last survey is not too fresh.
   * @param view says what is seen: it changes with the camera and with what is drawn
   */
  update(
    instances: readonly Instance[],
    camera: Camera,
    height: number,
    view: string,
    tell: { see(texels: Map<number, number>): void; again(): void },
  ): void {
    if (view !== this.last) this.isDone = false;
    if (this.isDone) return;
    const now = performance.now();
    if (now - this.lastTime < INTERVAL) {
      this.timer ??= setTimeout(() => {
        this.timer = undefined;
        tell.again();
      }, INTERVAL);
      return;
    }
    this.lastTime = now;
    this.last = view;
    this.isDone = true;
    tell.see(texelsOf(instances, camera, height));
  }
}

/** For each material in view: texels of a whole texture that could be told apart. */
export function texelsOf(
  instances: readonly Instance[],
  camera: Camera,
  height: number,
): Map<number, number> {
  const texels = new Map<number, number>();
  for (const instance of instances) {
    const world = instance.worldMatrix();
    const eye = eyeOf(camera, world);
    const pixels = pixelsPerUnit(camera, world, height);
    for (const { group, box } of instance.visibleGroups(frustumOf(camera, world))) {
      const least = NEAREST * (group.sphere[3] as number);
      const perUnit = pixels(Math.max(box.distanceToPoint(eye), least, 1e-30));
      group.sizeMaterials.forEach((material, i) => {
        const seen = perUnit * (group.sizes[i] as number);
        texels.set(material, Math.max(texels.get(material) ?? 0, seen));
      });
    }
  }
  return texels;
}
