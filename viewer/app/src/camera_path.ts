// Camera paths: recording, replay, and their files.

import { Vector3 } from "three";
import { type CameraPose, isPoint } from "./state";

interface Key extends CameraPose {
  /** Milliseconds from the start. */
  time: number;
}

/** The content of a file with a camera path. */
export interface PathFile {
  kind: "umbel-camera-path";
  keys: Key[];
}

/** Milliseconds between two keys. */
const STEP = 50;

export class CameraPath {
  isRecording = false;
  isReplaying = false;
  private keys: Key[] = [];
  private start = 0;

  get isEmpty(): boolean {
    return this.keys.length < 2;
  }

  startRecording(): void {
    this.keys = [];
    this.start = 0;
    this.isRecording = true;
    this.isReplaying = false;
  }

  startReplay(): void {
    if (this.isEmpty) return;
    this.start = 0;
    this.isRecording = false;
    this.isReplaying = true;
  }

  stop(): void {
    this.isRecording = false;
    this.isReplaying = false;
  }

  /** Records the camera's pose if a key is due. */
  record(time: number, pose: CameraPose): void {
    this.start ||= time;
    const since = time - this.start;
    const last = this.keys[this.keys.length - 1];
    if (!last || since - last.time >= STEP) this.keys.push({ ...pose, time: since });
  }

  /** The pose at a time; the last pose after the end, which stops the replay. */
  poseAt(time: number): CameraPose | undefined {
    this.start ||= time;
    const since = time - this.start;
    const next = this.keys.findIndex((key) => key.time > since);
    if (next <= 0) {
      if (next < 0) this.isReplaying = false;
      return this.keys[next < 0 ? this.keys.length - 1 : 0];
    }
    const [a, b] = [this.keys[next - 1], this.keys[next]];
    const t = (since - a.time) / (b.time - a.time);
    const between = (p: readonly number[], q: readonly number[]) =>
      new Vector3().fromArray(p).lerp(new Vector3().fromArray(q), t).toArray();
    return { position: between(a.position, b.position), target: between(a.target, b.target) };
  }

  toFile(): PathFile {
    return { kind: "umbel-camera-path", keys: this.keys };
  }

  /** Takes the path of a file; false if it has none. */
  fromFile(value: unknown): boolean {
    const file = value as Partial<PathFile> | null;
    if (file?.kind !== "umbel-camera-path" || !Array.isArray(file.keys)) return false;
    const isKey = (k: Partial<Key> | null) =>
      Number.isFinite(k?.time) && isPoint(k?.position) && isPoint(k?.target);
    if (file.keys.length < 2 || !file.keys.every(isKey)) return false;
    this.stop();
    this.keys = file.keys;
    return true;
  }
}
