// Allows more error while visible materials lack their textures, for a limited time.

import type { UmbelMesh } from "umbel/three";
import { UNTEXTURED_ERROR_FACTOR } from "./camera";

/** Milliseconds that geometry waits for textures, at most. */
const MAX_WAIT = 4000;

export class TextureWait {
  private started = 0;
  /** The meshes that wait no longer. */
  private readonly finished = new WeakSet<UmbelMesh>();

  /** Starts the wait for a mesh that was opened; calls `onEnd` when the time is over. */
  start(onEnd: () => void): void {
    this.started = performance.now();
    setTimeout(onEnd, MAX_WAIT);
  }

  /** The factor on a mesh's allowed error. */
  errorFactor(mesh: UmbelMesh): number {
    if (mesh.textures.isComplete || performance.now() - this.started > MAX_WAIT)
      this.finished.add(mesh);
    return this.finished.has(mesh) ? 1 : UNTEXTURED_ERROR_FACTOR;
  }
}
