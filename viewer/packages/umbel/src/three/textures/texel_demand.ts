// Measures the resolution at which the textures of each visible material are needed.

import type { Camera } from "three";
import { cameraPosition, frustumOf, pixelsPerUnit } from "../camera_view.js";
import type { MeshInstance } from "../mesh_instance.js";

/** Milliseconds between two measurements while the camera moves. */
const INTERVAL = 150;
/** Least distance to a group that counts, in radii of its sphere. */
const NEAREST = 0.02;

/** For materials, by their numbers: texels for each set of texture coordinates. */
export type TexelsByMaterial = ReadonlyMap<number, readonly number[]>;

export class TexelDemand {
  /** Whether the current view has been measured. */
  isDone = false;
  private last = "";
  private lastTime = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;

  /**
   * Measures the instances if the view has changed and the last measurement is old enough.
   * @param view a key that changes with the camera and the cut
   * @param listener `measured` gets the texels of each visible material, by its sets of texture
   *   coordinates; `again` asks for another call, because this one came too soon
   */
  update(
    instances: readonly MeshInstance[],
    camera: Camera,
    height: number,
    view: string,
    listener: { measured(texels: TexelsByMaterial): void; again(): void },
  ): void {
    if (view !== this.last) this.isDone = false;
    if (this.isDone) return;
    const now = performance.now();
    if (now - this.lastTime < INTERVAL) {
      this.timer ??= setTimeout(() => {
        this.timer = undefined;
        listener.again();
      }, INTERVAL);
      return;
    }
    this.lastTime = now;
    this.last = view;
    this.isDone = true;
    listener.measured(wantedTexels(instances, camera, height));
  }

  dispose(): void {
    clearTimeout(this.timer);
  }
}

/** For each visible material and set of texture coordinates: texels of a whole texture, one a pixel. */
export function wantedTexels(
  instances: readonly MeshInstance[],
  camera: Camera,
  height: number,
): TexelsByMaterial {
  const texels = new Map<number, number[]>();
  for (const instance of instances) {
    const world = instance.worldMatrix();
    const eye = cameraPosition(camera, world);
    const pixels = pixelsPerUnit(camera, world, height);
    for (const { group, box } of instance.visibleGroups(frustumOf(camera, world))) {
      const minDistance = NEAREST * (group.sphere[3] as number);
      const perUnit = pixels(Math.max(box.distanceToPoint(eye), minDistance, 1e-30));
      group.sizeMaterials.forEach((material, i) => {
        const wanted = perUnit * (group.sizes[i] as number);
        const set = group.sizeSets[i] as number;
        const ofSets = texels.get(material) ?? [];
        ofSets[set] = Math.max(ofSets[set] ?? 0, wanted);
        texels.set(material, ofSets);
      });
    }
  }
  return texels;
}
