// What each key does.

import { type Layout, PIXELS, type State } from "./state";
import type { Actions } from "./ui/panel";
import type { OrbitCamera } from "./viewport/orbit_camera";
import { VIEW_MODES, type ViewMode } from "./viewport/view_modes";

const LAYOUTS: readonly Layout[] = ["single", "side", "wipe"];
/** Factor on the allowed error of one press. */
const ERROR_STEP = 2 ** 0.5;
/** Parts of the distance to its target that the camera moves with one press. */
const PAN = 0.06;
const FLY = 0.08;

/** The keys whose actions go on while they are held; others act once a press. */
export const HELD_KEYS: ReadonlySet<string> = new Set([
  ...["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "PageUp", "PageDown"],
  ...["a", "d", "q", "e", "+", "=", "-"],
]);

/** Actions that only keys have. */
export interface KeyActions extends Actions {
  togglePanel(): void;
  deselect(): void;
}

/** The actions by `KeyboardEvent.key`, letters in lower case. */
export function keyBindings(
  state: State,
  camera: OrbitCamera,
  actions: KeyActions,
): Record<string, () => void> {
  return {
    ...modeKeys(state, actions),
    ...cameraKeys(camera),
    w: () => {
      state.wireframe = !state.wireframe;
      actions.change();
    },
    f: () => {
      state.frozen = !state.frozen;
      actions.change();
    },
    c: () => actions.setLayout(LAYOUTS[(LAYOUTS.indexOf(state.layout) + 1) % 3] as Layout),
    "+": () => scaleError(state, actions, 1 / ERROR_STEP),
    "=": () => scaleError(state, actions, 1 / ERROR_STEP),
    "-": () => scaleError(state, actions, ERROR_STEP),
    r: actions.record,
    p: actions.replay,
    Home: actions.frameAll,
    l: actions.share,
    s: actions.screenshot,
    o: actions.open,
    t: actions.theme,
    h: actions.togglePanel,
    "?": actions.help,
    Escape: actions.deselect,
  };
}

function modeKeys(state: State, actions: Actions): Record<string, () => void> {
  const modes = Object.keys(VIEW_MODES) as ViewMode[];
  const entries = modes.map((mode) => [
    VIEW_MODES[mode].key,
    () => {
      state.viewMode = mode;
      actions.change();
    },
  ]);
  return Object.fromEntries(entries);
}

function cameraKeys(camera: OrbitCamera): Record<string, () => void> {
  const [left, right] = [() => camera.fly(-PAN, 0, 0), () => camera.fly(PAN, 0, 0)];
  const [up, down] = [() => camera.fly(0, PAN, 0), () => camera.fly(0, -PAN, 0)];
  return {
    ArrowLeft: left,
    ArrowRight: right,
    ArrowUp: up,
    ArrowDown: down,
    a: left,
    d: right,
    q: down,
    e: up,
    PageUp: () => camera.fly(0, 0, FLY),
    PageDown: () => camera.fly(0, 0, -FLY),
  };
}

function scaleError(state: State, actions: Actions, factor: number): void {
  const pixels = state.pixelError * factor;
  state.pixelError = Math.min(Math.max(pixels, PIXELS.low), PIXELS.high);
  actions.change();
}
