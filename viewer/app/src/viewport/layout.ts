// Which part of the canvas each of two assets has.

import type { Layout } from "../state";

/** Left, bottom, width and height, in pixels of the page. */
export type Rectangle = readonly [number, number, number, number];

export interface Pane {
  /** Where the whole picture is projected to. */
  viewport: Rectangle;
  /** The part of it that is drawn. */
  scissor: Rectangle;
}

/** The position of the dividing line, from 0 (left) to 1. */
export function dividerAt(layout: Layout, wipe: number): number {
  return layout === "side" ? 0.5 : wipe;
}

/** The panes of the left and the right asset. */
export function panesOf(layout: Layout, wipe: number, width: number, height: number): [Pane, Pane] {
  const middle = Math.round(width * dividerAt(layout, wipe));
  const whole: Rectangle = [0, 0, width, height];
  const left: Rectangle = [0, 0, middle, height];
  const right: Rectangle = [middle, 0, width - middle, height];
  const isSide = layout === "side";
  return [
    { viewport: isSide ? left : whole, scissor: left },
    { viewport: isSide ? right : whole, scissor: right },
  ];
}
