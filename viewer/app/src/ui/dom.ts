// Makes elements of the page, and formats numbers.

type Child = Node | string | undefined;
type Properties<K extends keyof HTMLElementTagNameMap> = {
  [P in keyof HTMLElementTagNameMap[K]]?: HTMLElementTagNameMap[K][P] | undefined;
} & { aria?: Record<string, string>; data?: Record<string, string> };

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Properties<K> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  const { aria, data, ...rest } = properties;
  for (const [name, value] of Object.entries(rest))
    if (value !== undefined) (element as unknown as Record<string, unknown>)[name] = value;
  for (const [name, value] of Object.entries(aria ?? {}))
    element.setAttribute(`aria-${name}`, value);
  Object.assign(element.dataset, data);
  for (const child of children) if (child !== undefined) element.append(child);
  return element;
}

const number = new Intl.NumberFormat("en");

export function count(value: number): string {
  return number.format(Math.round(value));
}

export function short(value: number): string {
  if (value >= 1e6) return `${(value / 1e6).toFixed(value >= 1e7 ? 1 : 2)} M`;
  if (value >= 1e4) return `${(value / 1e3).toFixed(0)} k`;
  return count(value);
}

export function bytes(value: number): string {
  if (value >= 1e9) return `${(value / 1e9).toFixed(2)} GB`;
  if (value >= 1e6) return `${(value / 1e6).toFixed(value >= 1e8 ? 0 : 1)} MB`;
  return `${(value / 1e3).toFixed(0)} kB`;
}

export function significant(value: number): string {
  return value === Infinity ? "∞" : Number(value.toPrecision(3)).toString();
}
