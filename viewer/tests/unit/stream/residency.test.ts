import { expect, test } from "vitest";
import type { GroupInfo } from "../../../packages/umbel/src/decode/group.js";
import { cameraView } from "../../../packages/umbel/src/select/select.js";
import { RESIDENT } from "../../../packages/umbel/src/stream/page_cache.js";
import { Residency } from "../../../packages/umbel/src/stream/residency.js";
import { loadAsset } from "../../support/loaded_asset.js";
import { Random } from "../../support/random.js";

const { header: HEADER, dag: DAG } = loadAsset("planet");
const BUDGET = 4_000_000;

function infosOf(page: number): GroupInfo[] {
  return (DAG.groupsOfPage[page] ?? []).map((group) => DAG.info[group] as GroupInfo);
}

test("a thousand cuts keep the memory of resident pages within the budget", () => {
  const memoryOf = (info: GroupInfo) =>
    16 * info.vertexOffsets[info.clusterCount] + 12 * info.triangleOffsets[info.clusterCount];
  const residency = new Residency(HEADER, BUDGET, memoryOf);
  const random = new Random(9);
  for (let i = 0; i < 1000; ++i) {
    const [x, y, z] = [random.unit(), random.unit(), random.unit()];
    const view = cameraView([6 * x - 3, 6 * y - 3, 6 * z - 3], 0.8, 800, 2);
    residency.setViews([{ mesh: 0, view }]);
    residency.plan();
    for (let next = residency.next(); next; next = residency.next())
      residency.arrived(next.page, infosOf(next.page));
    residency.plan();
    if (residency.hasAbsentPages) residency.unblock();
  }
  let bytes = 0;
  for (let page = 0; page < residency.state.length; ++page)
    if (residency.state[page] === RESIDENT)
      for (const info of infosOf(page)) bytes += memoryOf(info);
  expect(bytes).toBe(residency.bytes);
  expect(residency.bytes).toBeLessThanOrEqual(BUDGET);
});
