// Sends the views of all instances to the stream whenever the camera or the object has moved.

import type { Matrix4 } from "three";
import type { AssetStream } from "../worker/asset_stream.js";
import { type CameraSettings, isSamePose, poseOf, sceneViewOf, viewOf } from "./camera_view.js";
import type { MeshInstance } from "./mesh_instance.js";

export class ViewTracker {
  /** Rises whenever the view changes. */
  version = 0;
  private lastView: number[][] = [];

  constructor(
    private readonly stream: AssetStream,
    private readonly instances: readonly MeshInstance[],
  ) {}

  /** @param world the object's matrix */
  update(settings: CameraSettings, world: Matrix4): void {
    const { camera, height, pixelError } = settings;
    const view = [[height, pixelError], ...poseOf(camera, world)];
    if (isSamePose(view, this.lastView)) return;
    this.lastView = view;
    ++this.version;
    if (this.stream.info.hasInstanceTree) {
      this.stream.setScene(sceneViewOf(settings, world));
      return;
    }
    this.stream.setViews(
      this.instances.map((instance) => ({
        mesh: instance.mesh,
        view: viewOf(settings, instance.worldMatrix()),
      })),
    );
  }
}
