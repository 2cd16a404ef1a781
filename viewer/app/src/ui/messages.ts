// What the page says in words: problems, short notes, the help.

import { h } from "./dom";

const KEYS: [string, string][] = [
  ["Drag, one finger", "turn"],
  ["Right button, two fingers", "move"],
  ["Wheel, pinch", "come closer"],
  ["Arrows or A D Q E", "move sideways, up, down"],
  ["Page up, page down", "fly forward, back"],
  ["Click", "pick a cluster"],
  ["1 to 7", "ways to look"],
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
  ["Esc", "close, let go"],
];

const TITLES: Record<string, string> = {
  network: "No connection",
  missing: "Not found",
  "not-umbel": "Not an .umbel file",
  version: "Another version",
  corrupt: "Damaged file",
};

/** What a kind of UmbelError is called. */
export function titleOf(kind: string): string {
  return TITLES[kind] ?? "This did not work";
}

export interface Choice {
  text: string;
  action(): void;
}

/** A card in the middle of the page: what is wrong, and what can be done. */
export class Problem {
  readonly element = h("div", { className: "problem", role: "alert", hidden: true });

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

/** A line at the foot of the page that goes away by itself, unless it is to stay. */
export class Notice {
  readonly element = h("div", { className: "notice", role: "status" });
  private timer = 0;

  show(text: string, stays = false): void {
    clearTimeout(this.timer);
    this.element.textContent = text;
    this.element.classList.add("shown");
    if (!stays) this.timer = window.setTimeout(() => this.hide(), 3500);
  }

  hide(): void {
    this.element.classList.remove("shown");
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
