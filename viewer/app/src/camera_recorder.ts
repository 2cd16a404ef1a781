// Records and replays the camera, with its notices.

import { CameraPath } from "./camera_path";
import { readJson, save } from "./files";
import type { Notice } from "./ui/messages";
import type { Panel } from "./ui/panel";
import type { OrbitCamera } from "./viewport/orbit_camera";

export class CameraRecorder {
  private readonly path = new CameraPath();

  constructor(
    private readonly panel: Panel,
    private readonly notice: Notice,
  ) {}

  toggleRecording(): void {
    if (this.path.isRecording) {
      this.path.stop();
      this.notice.show(this.path.isEmpty ? "Nothing moved." : "Recorded. P replays it.");
    } else this.path.startRecording();
    this.updatePanel();
  }

  toggleReplay(): void {
    if (this.path.isReplaying) this.path.stop();
    else this.path.startReplay();
    this.updatePanel();
  }

  stopReplay(): void {
    if (this.path.isReplaying) this.path.stop();
  }

  savePath(): void {
    const text = JSON.stringify(this.path.toFile());
    save(new Blob([text], { type: "application/json" }), "camera-path.json");
  }

  async openPath(file: File): Promise<void> {
    const isPath = this.path.fromFile(await readJson(file));
    this.notice.show(isPath ? "Camera path read: press P." : "This is not a camera path.");
    this.updatePanel();
  }

  /** Records or moves the camera before a frame; whether it needs another frame. */
  beforeFrame(time: number, camera: OrbitCamera): boolean {
    if (this.path.isRecording) {
      this.path.record(time, camera.pose);
      return true;
    }
    if (!this.path.isReplaying) return false;
    const pose = this.path.poseAt(time);
    if (pose) camera.setPose(pose);
    return this.path.isReplaying;
  }

  private updatePanel(): void {
    const text = "Recording: move the camera. R ends it.";
    this.notice.keep(this, this.path.isRecording ? text : undefined);
    this.panel.setPath(this.path.isRecording, !this.path.isEmpty);
  }
}
