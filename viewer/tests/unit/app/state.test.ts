import { expect, test } from "vitest";
import {
  type CameraPose,
  defaultState,
  nameOf,
  readLink,
  writeLink,
} from "../../../app/src/state.js";
import { translated } from "../../../app/src/viewport/camera.js";

const UTM = [448_250.125, 5_411_900.5, 312.0625] as const;

Object.assign(globalThis, {
  matchMedia: () => ({ matches: false }),
  document: { baseURI: "https://host.test/page/" },
  location: { search: "" },
});

test.each([
  ["models/a%20b.umbel?x=1", "a b.umbel"],
  ["100%25.umbel", "100%.umbel"],
  ["100%.umbel", "100%.umbel"],
  ["http://[bad", "http://[bad"],
])("the name of %s is %s", (address, name) => {
  expect(nameOf(address)).toBe(name);
});

test("links have the memory where it is not the usual one", () => {
  const pose = { position: [0, 0, 1] as [number, number, number], target: [0, 0, 0] as const };
  const write = (budget: number) =>
    writeLink({ ...defaultState(), budget }, { ...pose, target: [...pose.target] });
  expect(write(defaultState().budget)).not.toContain("budget");
  const state = defaultState();
  readLink(write(2 ** 26), state);
  expect(state.budget).toBe(2 ** 26);
});

test.each(["", "?compare=other.umbel"])("links on a page with %s have its layout", (search) => {
  location.search = search;
  for (const layout of ["single", "side", "wipe"] as const) {
    const state = defaultState();
    const pose = { position: [0, 0, 1], target: [0, 0, 0] } as CameraPose;
    readLink(writeLink({ ...state, layout }, pose), state);
    expect(state.layout).toBe(layout);
  }
  location.search = "";
});

test.each([
  "eye=1e300,0,0&target=0,0,0",
  "eye=0,0,NaN&target=0,0,0",
  "eye=,,&target=0,0,1",
  "eye=1,2&target=0,0,1",
  "eye=1,2,3,4&target=0,0,1",
  "eye=1,2,3&target=1,2,3",
  "eye=1,2,3",
])("the link %s has no camera", (link) => {
  expect(readLink(link, defaultState())).toBeUndefined();
});

test("links of no view mode leave it as it is", () => {
  for (const mode of ["constructor", "toString", "other"]) {
    const state = defaultState();
    readLink(`mode=${mode}`, state);
    expect(state.viewMode).toBe("shaded");
  }
});

test("links resolve a millionth of the distance to the target, in the world", () => {
  const near = { position: [0.25, 1.5, 3.000125] as const, target: [0.125, -0.5, 0] as const };
  const pose = translated({ position: [...near.position], target: [...near.target] }, UTM, 1);
  const read = readLink(writeLink(defaultState(), pose), defaultState());
  const back = translated(read ?? pose, UTM, -1);
  for (let i = 0; i < 3; ++i) {
    expect(Math.abs(back.position[i] - near.position[i])).toBeLessThan(4e-6);
    expect(Math.abs(back.target[i] - near.target[i])).toBeLessThan(4e-6);
  }
});
