// Lists the clusters of a cut as runs.

import { NONE } from "../format/file_header.js";
import type { GroupDag } from "../select/group_dag.js";
import { isDrawn } from "../select/refinement.js";

/** The cut that a view draws. */
export interface DrawnCut {
  /** See StreamUpdate.cuts. */
  runs: Uint32Array;
  triangles: number;
  clusters: number;
}

/** @param isPending whether the refinement of the group in a slot is selected but not resident */
export function drawnCut(
  dag: GroupDag,
  refined: Uint8Array,
  isPending: (slot: number) => boolean,
): DrawnCut {
  const runs: number[] = [];
  let triangles = 0;
  let clusters = 0;
  for (let g = 0; g < dag.count; ++g) {
    const info = dag.info[g];
    if (!refined[g] || !info || !isDrawn(dag, refined, g)) continue;
    const slots = dag.generating[g] as Uint32Array;
    let last = -1;
    for (let i = 0; i < info.clusterCount; ++i) {
      const generating = slots[i];
      if (generating !== NONE && refined[generating]) continue;
      const pending = generating !== NONE && isPending(generating) ? 1 : 0;
      const at = runs.length - 3;
      if (last === i - 1 && last >= 0 && runs[at + 2] === pending) ++(runs[at + 1] as number);
      else runs.push(info.firstCluster + i, 1, pending);
      last = i;
      triangles += info.triangleOffsets[i + 1] - info.triangleOffsets[i];
      ++clusters;
    }
  }
  return { runs: Uint32Array.from(runs), triangles, clusters };
}
