// The parts of glTF that an asset stores as JSON (docs/format.md, `MTRL` and `SCEN`). The reader
// checks none of it, so every access goes through these functions.

export type Json = Record<string, unknown>;

export function isJson(value: unknown): value is Json {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

export function jsonOf(value: unknown): Json {
  return isJson(value) ? value : {};
}

/** The objects of a list; an empty object replaces anything else, so that indices stay valid. */
export function listOf(value: unknown): Json[] {
  return Array.isArray(value) ? value.map(jsonOf) : [];
}

export function numberOf(value: unknown, otherwise: number): number {
  return typeof value === "number" && Number.isFinite(value) ? value : otherwise;
}

export function numbersOf(value: unknown, otherwise: readonly number[]): number[] {
  const given = Array.isArray(value) ? value : [];
  return otherwise.map((each, i) => numberOf(given[i], each));
}

export function textOf(value: unknown): string {
  return typeof value === "string" ? value : "";
}

/** The sets of texture coordinates that materials use, and always the first. */
export function uvSetsOf(materials: Json): Set<number> {
  const sets = new Set([0]);
  const open: unknown[] = [materials.materials];
  while (open.length > 0) {
    const value = open.pop();
    if (typeof value !== "object" || value === null) continue;
    for (const [name, inner] of Object.entries(value)) {
      if (name === "texCoord" && typeof inner === "number") sets.add(inner);
      else if (typeof inner === "object") open.push(inner);
    }
  }
  return sets;
}
