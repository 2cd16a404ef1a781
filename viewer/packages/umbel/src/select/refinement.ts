// Finds the cut to draw: as close to the selected one as the resident pages allow.
//
// A refinement is a set of groups that holds, with every group, all of the group's parents. It
// defines a cut of the DAG: a cluster is drawn if its own group is in the set and the group that it
// was made from is not. So a group whose clusters are all refined needs no geometry.

import type { GroupDag } from "./group_dag.js";

/** The part of the DAG that these functions read. */
export type Dag = Pick<GroupDag, "count" | "finer" | "coarser" | "hasSource">;

/** Whether a cluster of a group in the set is drawn, so that the group's page is needed. */
export function isDrawn({ finer, hasSource }: Dag, refined: Uint8Array, group: number): boolean {
  if (hasSource[group]) return true;
  const children = finer[group];
  for (let i = 0; i < children.length; ++i) if (!refined[children[i]]) return true;
  return false;
}

/**
 * Removes groups from a set until it is a refinement that draws resident groups only. The result is
 * the largest such subset; it is unique, because the union of two such subsets is another.
 */
export function keepDrawable(dag: Dag, refined: Uint8Array, isResident: Uint8Array): void {
  const { finer, coarser } = dag;
  const removed: number[] = [];
  const remove = (group: number) => {
    if (!refined[group]) return;
    refined[group] = 0;
    removed.push(group);
  };
  for (let g = 0; g < dag.count; ++g) {
    if (!refined[g]) continue;
    let stays = isResident[g] !== 0 || !isDrawn(dag, refined, g);
    const above = coarser[g];
    for (let i = 0; stays && i < above.length; ++i) stays = refined[above[i]] !== 0;
    if (!stays) remove(g);
  }
  for (let g = removed.pop(); g !== undefined; g = removed.pop()) {
    for (const below of finer[g]) remove(below);
    for (const above of coarser[g]) if (!isResident[above]) remove(above);
  }
}

/**
 * Removes from a drawable refinement the groups that are not in `target`, and puts back those that
 * hide groups which would then be drawn without being resident.
 */
export function coarsen(
  dag: Dag,
  refined: Uint8Array,
  target: Uint8Array,
  isResident: Uint8Array,
): void {
  const { finer, coarser } = dag;
  const added: number[] = [];
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
    added.push(group);
  };
  for (let hidden = toHide.pop(); hidden !== undefined; hidden = toHide.pop()) {
    if (!isDrawn(dag, refined, hidden)) continue;
    for (const below of finer[hidden]) add(below);
    for (let g = added.pop(); g !== undefined; g = added.pop()) {
      checkLater(g);
      for (const above of coarser[g]) add(above);
    }
  }
}

/**
 * The refinement to draw: as close to `target` as the resident pages allow. It stays finer than the
 * target where the target's coarser pages have not arrived.
 */
export function nextRefinement(
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
