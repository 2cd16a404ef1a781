// What can be drawn of what should be: groups as a DAG, and the best refinement for which every
// page is here.
//
// A refinement is a set of groups that, with a group, holds all the groups that it was simplified
// to. A cluster is drawn if its own group is in the set and its generating group is not; so a
// group whose clusters have all been refined needs no geometry, only to be known.

import type { Catalog } from "./catalog.js";

/** Groups, and which were made from which. */
export type Dag = Pick<Catalog, "count" | "finer" | "coarser" | "hasSource">;

/** Whether some cluster of a group of the set is drawn, so that its page is needed. */
export function isDrawn({ finer, hasSource }: Dag, refined: Uint8Array, group: number): boolean {
  if (hasSource[group]) return true;
  const made = finer[group];
  for (let i = 0; i < made.length; ++i) if (!refined[made[i]]) return true;
  return false;
}

/**
 * Takes groups out of a set until it is a refinement with a page for all that it draws. The result
 * is the largest such subset: any two have a union that is one too.
 */
export function keepDrawable(dag: Dag, refined: Uint8Array, isResident: Uint8Array): void {
  const { finer, coarser } = dag;
  const leaving: number[] = [];
  const leave = (group: number) => {
    if (!refined[group]) return;
    refined[group] = 0;
    leaving.push(group);
  };
  for (let g = 0; g < dag.count; ++g) {
    if (!refined[g]) continue;
    let stays = isResident[g] !== 0 || !isDrawn(dag, refined, g);
    const above = coarser[g];
    for (let i = 0; stays && i < above.length; ++i) stays = refined[above[i]] !== 0;
    if (!stays) leave(g);
  }
  for (let g = leaving.pop(); g !== undefined; g = leaving.pop()) {
    for (const below of finer[g]) leave(below);
    for (const above of coarser[g]) if (!isResident[above]) leave(above);
  }
}

/**
 * Takes out of a drawable refinement all that is not in `target`, and puts back what hides groups
 * that would be drawn then but are not here.
 */
export function coarsen(
  dag: Dag,
  refined: Uint8Array,
  target: Uint8Array,
  isResident: Uint8Array,
): void {
  const { finer, coarser } = dag;
  const adding: number[] = [];
  const toHide: number[] = [];
  const checkLater = (group: number) => {
    if (!isResident[group]) toHide.push(group);
  };
  for (let g = 0; g < dag.count; ++g) {
    refined[g] &= target[g];
    if (refined[g]) checkLater(g);
  }
  const add = (group: number) => {
    if (refined[group]) return;
    refined[group] = 1;
    adding.push(group);
  };
  for (let hidden = toHide.pop(); hidden !== undefined; hidden = toHide.pop()) {
    if (!isDrawn(dag, refined, hidden)) continue;
    for (const below of finer[hidden]) add(below);
    for (let g = adding.pop(); g !== undefined; g = adding.pop()) {
      checkLater(g);
      for (const above of coarser[g]) add(above);
    }
  }
}

/**
 * What to draw now: as close to `target` as the pages allow, and not coarser than what was drawn
 * before only because the target is coarser still and has not arrived.
 */
export function settle(
  dag: Dag,
  target: Uint8Array,
  before: Uint8Array,
  isResident: Uint8Array,
): Uint8Array {
  const refined = target.map((wanted, g) => wanted | before[g]);
  keepDrawable(dag, refined, isResident);
  coarsen(dag, refined, target, isResident);
  return refined;
}
