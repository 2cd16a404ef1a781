// Messages: the error card, short notices, and the help dialog.

import { h } from "./dom";

const KEYS: [string, string][] = [
  ["Drag, one finger", "turn"],
  ["Right button, two fingers", "move"],
  ["Wheel, pinch", "come closer"],
  ["Arrows or A D Q E", "move sideways, up, down"],
  ["Page up, page down", "fly forward, back"],
  ["Click", "pick a cluster"],
  ["1 to 7", "view modes"],
  ["W", "wireframe"],
  ["F", "freeze"],
  ["+ and −", "less and more error"],
  ["C", "one, side by side, wipe"],
  ["R, P", "record, replay the camera"],
  ["Home", "the whole asset"],
  ["L, S", "copy a link, save a picture"],
  ["O", "open a file"],
  ["T", "dark or light"],
  ["H", "hide the settings"],
  ["Esc", "close, deselect"],
];

const TITLES: Record<string, string> = {
  network: "No connection",
  missing: "Not found",
  refused: "No access",
  "not-umbel": "Not an .umbel file",
  version: "Another version",
  corrupt: "Damaged file",
  memory: "No memory left",
};

/** The title of a kind of UmbelError. */
export function titleOf(kind: string): string {
  return TITLES[kind] ?? "This did not work";
}

export interface Choice {
  text: string;
  action(): void;
}

/** A card in the middle of the page: an error, and buttons to go on. */
export class ErrorCard {
  readonly element = h("div", { className: "error-card", role: "alert", hidden: true });

  show(title: string, message: string, choices: readonly Choice[]): void {
    this.element.replaceChildren(
      h("h1", { textContent: title }),
      h("p", { textContent: message }),
      h(
        "div",
        { className: "buttons" },
        ...choices.map(({ text, action }) =>
          h("button", { type: "button", textContent: text, onclick: action }),
        ),
      ),
    );
    this.element.hidden = false;
  }

  hide(): void {
    this.element.hidden = true;
  }
}

/** A line at the bottom of the page: the latest short message, then the latest that stays. */
export class Notice {
  readonly element = h("div", { className: "notice", role: "status" });
  private timer = 0;
  private short: string | undefined;
  /** By what they are about. */
  private readonly staying = new Map<unknown, string>();

  /** Shows a line for some seconds. */
  show(text: string): void {
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.end(), 3500);
    this.short = text;
    this.update();
  }

  /** Shows a line about something until there is another one, or none (undefined). */
  keep(about: unknown, text: string | undefined): void {
    if (text === this.staying.get(about)) return;
    this.staying.delete(about);
    if (text !== undefined) {
      this.staying.set(about, text);
      this.short = undefined;
    }
    this.update();
  }

  /** Hides a short line. */
  end(): void {
    clearTimeout(this.timer);
    this.short = undefined;
    this.update();
  }

  private update(): void {
    const text = this.short ?? [...this.staying.values()].at(-1);
    this.element.classList.toggle("shown", text !== undefined);
    if (text !== undefined) this.element.textContent = text;
  }
}

export function helpDialog(): HTMLDialogElement {
  const dialog = h(
    "dialog",
    { className: "help", aria: { label: "Keys" } },
    h("h1", { textContent: "Keys and gestures" }),
    h(
      "dl",
      {},
      ...KEYS.flatMap(([key, does]) => [
        h("dt", { textContent: key }),
        h("dd", { textContent: does }),
      ]),
    ),
    h("form", { method: "dialog" }, h("button", { textContent: "Close" })),
  );
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
  return dialog;
}
