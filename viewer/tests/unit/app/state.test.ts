import { expect, test } from "vitest";
import { defaultState, readLink, writeLink } from "../../../app/src/state.js";
import { translated } from "../../../app/src/viewport/camera.js";
import { readFileHeader } from "../../../packages/umbel/src/format/file_header.js";
import { assetBytes } from "../../support/assets.js";
import { jsonSection, originSection, withSections } from "../../support/rewrite.js";

const FILE = assetBytes("blob_16bits_compact");
const UTM: [number, number, number] = [448_250.125, 5_411_900.5, 312.0625];

test("an origin and a scene are read where the file has them", () => {
  const plain = readFileHeader(FILE);
  expect(plain.origin).toEqual([0, 0, 0]);
  expect(plain.scene).toEqual({});
  const scene = { asset: { copyright: "someone" }, nodes: [{ name: "roof" }] };
  const moved = readFileHeader(
    withSections(FILE, [originSection(...UTM), jsonSection("SCEN", scene)]),
  );
  expect(moved.origin).toEqual(UTM);
  expect(moved.scene).toEqual(scene);
  expect({ ...moved.meshes[0], roots: 0 }).toEqual({ ...plain.meshes[0], roots: 0 });
  expect(readFileHeader(withSections(FILE, [originSection()])).origin).toEqual([0, 0, 0]);
});

test("an origin that is no place is refused", () => {
  for (const bad of [originSection(1, Number.NaN, 2), originSection(1, 2, 3, 4, 5, 6)])
    expect(() => readFileHeader(withSections(FILE, [bad]))).toThrow("origin");
});

test("links carry poses in the world to a millionth of what is looked at", () => {
  Object.assign(globalThis, { matchMedia: () => ({ matches: false }) });
  const near = { position: [0.25, 1.5, 3.000125] as const, target: [0.125, -0.5, 0] as const };
  const pose = translated({ position: [...near.position], target: [...near.target] }, UTM, 1);
  const read = readLink(writeLink(defaultState(), pose), defaultState());
  const back = translated(read ?? pose, UTM, -1);
  for (let i = 0; i < 3; ++i) {
    expect(Math.abs(back.position[i] - near.position[i])).toBeLessThan(4e-6);
    expect(Math.abs(back.target[i] - near.target[i])).toBeLessThan(4e-6);
  }
});
