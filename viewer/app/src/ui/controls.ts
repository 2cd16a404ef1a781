// The panel's controls: buttons, check boxes and logarithmic sliders.

import { h } from "./dom";

export function button(
  text: string,
  title: string,
  onclick: () => void,
  id?: string,
): HTMLButtonElement {
  return h("button", { type: "button", textContent: text, title, onclick, id });
}

export function section(title: string, ...children: Node[]): HTMLElement {
  return h("section", {}, h("h2", { textContent: title }), ...children);
}

/** A row of buttons; one of them is pressed. */
export class Choice<Key extends string> {
  readonly element: HTMLElement;
  private readonly buttons = new Map<Key, HTMLButtonElement>();

  /**
   * @param label what is chosen, for screen readers
   * @param name the buttons' data attribute
   * @param choices text and title of each button
   */
  constructor(
    label: string,
    className: string,
    name: string,
    choices: Readonly<Record<Key, readonly [string, string]>>,
    onChoose: (key: Key) => void,
  ) {
    for (const key of Object.keys(choices) as Key[]) {
      const [text, title] = choices[key];
      const element = button(text, title, () => onChoose(key));
      element.dataset[name] = key;
      this.buttons.set(key, element);
    }
    const group = { className, role: "group", aria: { label } };
    this.element = h("div", group, ...this.buttons.values());
  }

  set(chosen: Key): void {
    for (const [key, element] of this.buttons)
      element.setAttribute("aria-pressed", String(key === chosen));
  }
}

export class Toggle {
  readonly element: HTMLElement;
  private readonly input: HTMLInputElement;

  constructor(text: string, title: string, id: string, onChange: (isOn: boolean) => void) {
    this.input = h("input", {
      type: "checkbox",
      id,
      onchange: () => onChange(this.input.checked),
    });
    this.element = h("label", { className: "toggle", title }, this.input, h("span", {}, text));
  }

  set(isOn: boolean): void {
    this.input.checked = isOn;
  }
}

export interface LogSliderOptions {
  name: string;
  /** Description for screen readers. */
  label: string;
  id: string;
  range: { low: number; high: number };
  format(value: number): string;
  onInput(value: number): void;
}

/** A slider on a logarithmic scale. */
export class LogSlider {
  readonly element: HTMLElement;
  private readonly input: HTMLInputElement;
  private readonly output = h("output", { className: "value" });

  constructor(private readonly options: LogSliderOptions) {
    const { name, label, id, range, onInput } = options;
    const { low, high } = range;
    this.input = h("input", {
      type: "range",
      min: "0",
      max: "1",
      step: "0.002",
      id,
      aria: { label },
      oninput: () => onInput(low * (high / low) ** Number(this.input.value)),
    });
    this.element = h(
      "label",
      { className: "slider" },
      h("span", { className: "name", textContent: name }),
      this.output,
      this.input,
    );
  }

  set(value: number): void {
    const { low, high } = this.options.range;
    this.input.value = String(Math.log(value / low) / Math.log(high / low));
    this.output.textContent = this.options.format(value);
    // Screen readers would read the position on the scale.
    this.input.setAttribute("aria-valuetext", this.output.textContent);
  }
}
