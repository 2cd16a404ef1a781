import { expect, test } from "vitest";
import type { GroupInfo } from "../../../packages/umbel/src/decode/group.js";
import { readPage } from "../../../packages/umbel/src/decode/page.js";
import { NONE } from "../../../packages/umbel/src/format/file_header.js";
import type { GroupDag } from "../../../packages/umbel/src/select/group_dag.js";
import { cameraView } from "../../../packages/umbel/src/select/select.js";
import { RESIDENT } from "../../../packages/umbel/src/stream/page_cache.js";
import { Residency } from "../../../packages/umbel/src/stream/residency.js";
import { loadAsset, targetOf } from "../../support/loaded_asset.js";
import { Random } from "../../support/random.js";

const PLANET = loadAsset("planet");
const { file: FILE, header: HEADER } = PLANET;
const BUDGET = 4_000_000;
const { offset: OFFSET, size: SIZE, count: PAGES } = HEADER.pages;
/** The groups of each page. */
const INFOS = Array.from({ length: PAGES }, (_, page) =>
  readPage(HEADER, page, FILE.subarray(OFFSET[page], OFFSET[page] + SIZE[page])).map(
    ({ info }) => info,
  ),
);

function infosOf(page: number): GroupInfo[] {
  return INFOS[page];
}

const memoryOf = (info: GroupInfo) =>
  16 * info.vertexOffsets[info.clusterCount] + 12 * info.triangleOffsets[info.clusterCount];

test("a thousand cuts keep the memory of resident pages within the budget", () => {
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

test("what is known follows the cuts, and pages that were forgotten are fetched again", () => {
  const PAGED = loadAsset("paged");
  const { offset, size } = PAGED.header.pages;
  const read = (page: number) =>
    readPage(PAGED.header, page, PAGED.file.subarray(offset[page], offset[page] + size[page]));
  // Less than what all cameras show.
  const residency = new Residency(PAGED.header, 1_200_000, memoryOf, 20);
  const { dag } = residency;
  const random = new Random(4);
  const seen = new Set<number>();
  let exact = 0;
  for (let i = 0; i < 30; ++i) {
    const angle = 7 * random.unit();
    const far = i % 3 === 0 ? 1.2 : 4;
    const view = cameraView([far * Math.cos(angle), 0.2, far * Math.sin(angle)], 0.8, 800, 24);
    residency.setViews([{ mesh: 0, view }]);
    do {
      residency.plan();
      for (let next = residency.next(); next; next = residency.next()) {
        seen.add(next.page);
        residency.arrived(
          next.page,
          read(next.page).map(({ info }) => info),
        );
      }
      residency.plan();
      if (residency.hasAbsentPages) residency.unblock();
    } while (!residency.isSettled);
    if (residency.scale > 1) continue;
    ++exact;
    const groupsIn = (set: Uint8Array, of: GroupDag) =>
      [...set.keys()].filter((g) => set[g]).map((g) => of.group[g]);
    const wanted = groupsIn(targetOf(PAGED, view), PAGED.dag);
    expect(groupsIn(residency.refined(0), dag).sort()).toEqual(wanted.sort());
  }
  expect(exact).toBeGreaterThan(5);
  expect(seen.size).toBeGreaterThan(150);
  expect(dag.slotsOfPage.size).toBeLessThan(0.8 * seen.size);
  const free = [...dag.group.subarray(0, dag.count)].filter((group) => group === NONE).length;
  expect(free).toBeGreaterThan(0);
  for (let slot = 0; slot < dag.count; ++slot)
    if (dag.group[slot] !== NONE) expect(dag.slotOf(dag.group[slot])).toBe(slot);
});
