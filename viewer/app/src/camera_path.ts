// Camera paths: recorded, replayed, saved and read.

import { Vector3 } from "three";
import type { CameraPose } from "./state";

interface Key extends CameraPose {
  /** Milliseconds from the start. */
  time: number;
}

/** A file of this kind can be dropped on the page. */
export interface PathFile {
  kind: "umbel-camera-path";
  keys: Key[];
}

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
    this.isReplaying = true;
  }

  stop(): void {
    this.isRecording = false;
    this.isReplaying = false;
  }

  /** Takes the camera's pose at a time, if it is due. */
  record(time: number, pose: CameraPose): void {
    this.start ||= time;
    const since = time - this.start;
    const last = this.keys[this.keys.length - 1];
    if (!last || since - last.time >= STEP) this.keys.push({ ...pose, time: since });
  }

  /** The pose at a time; undefined behind the end. */
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

  /** Whether this was a camera path. */
  fromFile(value: unknown): boolean {
    const file = value as Partial<PathFile> | null;
    if (file?.kind !== "umbel-camera-path" || !Array.isArray(file.keys)) return false;
    const isVector = (v: unknown) => Array.isArray(v) && v.length === 3 && v.every(Number.isFinite);
    if (
      !file.keys.every((k) => Number.isFinite(k.time) && isVector(k.position) && isVector(k.target))
    )
      return false;
    this.keys = file.keys;
    return !this.isEmpty;
  }
}
