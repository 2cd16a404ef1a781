"""What more machines bring: a build in units is measured stage by stage, and one of any size
simulated from that, on any number of workers.

    python bench/scale_cluster.py --measure 4000000
    python bench/scale_cluster.py --simulate 1.6e9 16e9 --workers 1 8 64 512
"""

from __future__ import annotations

import argparse
import heapq
import json
import random
import tempfile
import time
from pathlib import Path

UNIT = 4 << 20
#: Of a unit's most triangles, what planes between cells leave in it.
_FILL = 0.8
#: Units of one size take times that differ by so much (standard deviation, relative).
_SPREAD = 0.1
#: Seconds between a task that is submitted and its first line.
_START = 0.05
#: How many times as fast as one core the driver reads and divides. On two cores it was 1.7 times;
#: more were not measured.
_DRIVER_CORES = 4
#: Triangles of a stretch of the source that a task sorts, and how much it fetches of tiles that do
#: not end where it does.
_STRETCH, _TILES = 2 << 20, 1.5
#: Machines have so many workers, which share their network.
_WORKERS = 16


def measure(triangles: int) -> dict[str, float]:
    """Microseconds and bytes a triangle of each stage, on one core."""
    import fsspec

    import umbel
    from umbel.scale.executor import InProcess, Result
    from umbel.testing import giant

    spent: dict[str, float] = {}
    last = ["reading", time.process_time()]

    class Timed(InProcess):
        """Others may use the machine, so it is the processor's time that counts."""

        def wait(self, seconds: float) -> Result | None:
            began = time.process_time()
            result = super().wait(seconds)
            if result:
                result.measured["busy"] = time.process_time() - began
            return result

    def progress(_: float, stage: str) -> None:
        now = time.process_time()
        spent[last[0]] = spent.get(last[0], 0) + now - last[1]
        last[:] = [stage, now]

    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "mesh.ply"
        giant.write(giant.terrain(triangles, seed=1), mesh)
        fsspec.filesystem("memory").put_file(str(mesh), "/source/mesh.ply")
        source_bytes = mesh.stat().st_size
        last[1] = time.process_time()
        report = umbel.build_asset(
            "memory://source/mesh.ply",
            "memory://asset.umbel",
            work="memory://work",
            unit_triangles=triangles // 8,
            executor=Timed(),
            progress=progress,
            threads=1,
        )
        progress(1, "end")
    total = report["input_triangles"]
    per = 1e6 / total
    tasks = report["tasks"]

    def summed(kind: str, is_first: bool, what: str = "busy") -> float:
        return sum(t[what] for t in tasks if t["kind"] == kind and (t["tier"] == 0) == is_first)

    def of_all(kind: str, what: str) -> float:
        return summed(kind, True, what) + summed(kind, False, what)

    writing = sum(v for k, v in spent.items() if k == "writing")
    writing -= of_all("encode", "busy")
    later = [t for t in tasks if t["tier"] > 0]
    return {
        "source_bytes": source_bytes / total,
        "passes_us": (spent.get("reading", 0) + spent.get("dividing", 0)) * per,
        "sort_us": summed("sort", True) * per,
        "first_us": summed("build", True) * per,
        "later_us": (summed("build", False) + summed("sort", False)) * per,
        "planning_us": spent.get("planning", 0) * per,
        "encode_us": of_all("encode", "busy") * per,
        "writing_us": max(0.0, writing) * per,
        "routed_bytes": summed("sort", True, "store_bytes") / total,
        "first_bytes": summed("build", True, "store_bytes") / total,
        "later_bytes": sum(
            t["fetch_bytes"] + t["store_bytes"] for t in later if t["kind"] != "encode"
        )
        / total,
        "encode_bytes": of_all("encode", "fetch_bytes") / total,
        "kept_bytes": sum(t["kept_bytes"] for t in tasks if t["kind"] != "encode") / total,
        "asset_bytes": report["file_bytes"] / total,
    }


def simulate(
    triangles: float, workers: int, cost: dict[str, float], network: float
) -> tuple[float, float, float]:
    """Seconds of a build: of the driver alone, of tasks, and of the driver's network where all wait
    for it. `network`: bytes a second of each machine."""
    chance = random.Random(1)

    def tasks(count: int, seconds: float, moved: float) -> float:
        """`count` tasks that take and move so much in all."""
        share = network / min(_WORKERS, workers)
        each = seconds / count + _START + moved / count / share
        return _schedule(count, workers, each, chance)

    micro = 1e-6 * triangles
    # The driver has a copy of the source.
    waits = cost["source_bytes"] * triangles / network
    driver = cost["passes_us"] * micro / _DRIVER_CORES
    moved = (_TILES * cost["source_bytes"] + cost["routed_bytes"]) * triangles
    work = tasks(max(1, round(triangles / _STRETCH)), cost["sort_us"] * micro, moved)
    moved = (cost["routed_bytes"] + cost["first_bytes"]) * triangles
    left, units = triangles, 0
    seconds = cost["first_us"] * micro
    while True:
        count = max(1, round(left / (UNIT * _FILL)))
        units += count
        work += tasks(count, seconds, moved)
        if count == 1:
            break
        # The barrier: the driver plans by what is said of exits. Tiers leave a quarter each, and
        # all after the first cost together what was measured.
        driver += cost["planning_us"] * 1e-6 * left * 0.75 / _DRIVER_CORES
        left /= 4
        seconds = cost["later_us"] * 1e-6 * left * 3
        moved = cost["later_bytes"] * left * 3
    waits += cost["kept_bytes"] * triangles / network
    work += tasks(
        units, cost["encode_us"] * micro, (cost["encode_bytes"] + cost["asset_bytes"]) * triangles
    )
    # Pages are written one after the other, and the asset is stored.
    driver += cost["writing_us"] * micro
    waits += 2 * cost["asset_bytes"] * triangles / network
    return driver, work, waits


def _schedule(count: int, workers: int, each: float, chance: random.Random) -> float:
    """When the last of so many units is done."""
    ends = [0.0] * min(workers, count)
    for _ in range(count):
        heapq.heappush(ends, heapq.heappop(ends) + each * max(0.5, chance.gauss(1, _SPREAD)))
    return max(ends)


def main() -> None:
    """The table, as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--measure", type=int, metavar="TRIANGLES")
    parser.add_argument("--costs", type=Path, default=Path("bench/results/scale-costs.json"))
    parser.add_argument("--simulate", type=float, nargs="*", default=[])
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 8, 64, 512])
    parser.add_argument("--network", type=float, default=1.25e9, help="bytes a second a machine")
    options = parser.parse_args()
    if options.measure:
        options.costs.write_text(json.dumps(measure(options.measure), indent=1) + "\n")
    cost = json.loads(options.costs.read_text())
    print("| triangles | workers | s | speed-up | tasks | driver | its network |")
    print("| --: | --: | --: | --: | --: | --: | --: |")
    for triangles in options.simulate:
        alone = None
        for workers in options.workers:
            driver, units, waits = simulate(triangles, workers, cost, options.network)
            total = driver + units + waits
            alone = alone or total
            print(
                f"| {triangles / 1e9:g} G | {workers} | {total:,.0f} | {alone / total:.1f} | "
                f"{units / total:.0%} | {driver / total:.0%} | {waits / total:.0%} |"
            )


if __name__ == "__main__":
    main()
