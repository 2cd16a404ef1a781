import { expect, test } from "vitest";
import { CameraPath } from "../../../app/src/camera_path.js";

const KEYS = [0, 1].map((time) => ({ time, position: [0, 0, 2 + time], target: [0, 0, 0] }));

test("paths of files are read", () => {
  const path = new CameraPath();
  path.startRecording();
  expect(path.fromFile({ kind: "umbel-camera-path", keys: KEYS })).toBe(true);
  expect(path.isRecording).toBe(false);
  expect(path.toFile().keys).toEqual(KEYS);
});

test("a replay ends the recording", () => {
  const path = new CameraPath();
  path.startRecording();
  for (const [i, { position, target }] of KEYS.entries())
    path.record(1000 + 100 * i, { position: [0, 0, position[2]], target: [0, 0, target[2]] });
  path.startReplay();
  expect([path.isRecording, path.isReplaying]).toEqual([false, true]);
  expect(path.toFile().keys.map(({ time }) => time)).toEqual([0, 100]);
});

test.each([
  null,
  [],
  { kind: "other", keys: KEYS },
  { kind: "umbel-camera-path" },
  { kind: "umbel-camera-path", keys: [null, null] },
  { kind: "umbel-camera-path", keys: [KEYS[0]] },
  { kind: "umbel-camera-path", keys: [KEYS[0], { ...KEYS[1], position: [1e300, 0, 0] }] },
])("what is no path leaves the one before: %j", (file) => {
  const path = new CameraPath();
  path.fromFile({ kind: "umbel-camera-path", keys: KEYS });
  expect(path.fromFile(file)).toBe(false);
  expect(path.toFile().keys).toEqual(KEYS);
});
