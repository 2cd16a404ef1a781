// What can be drawn of what should be: groups as a DAG, and the best refinement for which every
// page is here.
//
// A refinement is a set of groups that, with a group, holds all the groups that it was simplified
// to. A cluster is drawn if its own group is in the set and its generating group is not; so a
// group whose clusters have all been refined needs no page, and pages between what was shown and
// what is wanted need never be fetched.

import { NONE, type Tables } from "./tables.js";

/** Lists of lists of groups. */
interface Links {
  offsets: Uint32Array;
  targets: Uint32Array;
}

export interface Dag {
  groups: number;
  /** For each group those that its clusters were made from. */
  finer: Links;
  /** For each group those that hold what it was simplified to. */
  coarser: Links;
  /** 1 where some of a group's clusters were made from nothing. */
  hasSource: Uint8Array;
}

export function makeDag({ groups, clusters }: Pick<Tables, "groups" | "clusters">): Dag {
  const hasSource = new Uint8Array(groups.count);
  const from: number[] = [];
  const to: number[] = [];
  const seen = new Uint32Array(groups.count).fill(NONE);
  for (let g = 0; g < groups.count; ++g) {
    const end = groups.firstCluster[g] + groups.clusterCount[g];
    for (let c = groups.firstCluster[g]; c < end; ++c) {
      const generating = clusters.generating[c];
      if (generating === NONE) hasSource[g] = 1;
      else if (seen[generating] !== g) {
        seen[generating] = g;
        from.push(g);
        to.push(generating);
      }
    }
  }
  return {
    groups: groups.count,
    finer: links(groups.count, from, to),
    coarser: links(groups.count, to, from),
    hasSource,
  };
}

function links(count: number, from: readonly number[], to: readonly number[]): Links {
  const offsets = new Uint32Array(count + 1);
  for (const g of from) ++offsets[g + 1];
  for (let g = 0; g < count; ++g) offsets[g + 1] += offsets[g];
  const next = offsets.slice();
  const targets = new Uint32Array(to.length);
  from.forEach((g, i) => {
    targets[next[g]++] = to[i];
  });
  return { offsets, targets };
}

/** Whether some cluster of a group of the set is drawn, so that its page is needed. */
export function isDrawn({ finer, hasSource }: Dag, refined: Uint8Array, group: number): boolean {
  if (hasSource[group]) return true;
  for (let i = finer.offsets[group]; i < finer.offsets[group + 1]; ++i)
    if (!refined[finer.targets[i]]) return true;
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
  for (let g = 0; g < dag.groups; ++g) {
    if (!refined[g]) continue;
    let stays = isResident[g] !== 0 || !isDrawn(dag, refined, g);
    for (let i = coarser.offsets[g]; stays && i < coarser.offsets[g + 1]; ++i)
      stays = refined[coarser.targets[i]] !== 0;
    if (!stays) leave(g);
  }
  for (let g = leaving.pop(); g !== undefined; g = leaving.pop()) {
    for (let i = finer.offsets[g]; i < finer.offsets[g + 1]; ++i) leave(finer.targets[i]);
    for (let i = coarser.offsets[g]; i < coarser.offsets[g + 1]; ++i) {
      const above = coarser.targets[i];
      if (!isResident[above]) leave(above);
    }
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
  for (let g = 0; g < dag.groups; ++g) {
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
    for (let i = finer.offsets[hidden]; i < finer.offsets[hidden + 1]; ++i) add(finer.targets[i]);
    for (let g = adding.pop(); g !== undefined; g = adding.pop()) {
      checkLater(g);
      for (let i = coarser.offsets[g]; i < coarser.offsets[g + 1]; ++i) add(coarser.targets[i]);
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
