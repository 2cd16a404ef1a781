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
#: How many times as fast as one core the driver sorts and writes. On two cores it was 1.7 times;
#: more were not measured.
_DRIVER_CORES = 4


def measure(triangles: int) -> dict[str, float]:
    """Microseconds and bytes a triangle of each stage, on one core."""
    import umbel
    from umbel.scale.executor import InProcess
    from umbel.testing import giant

    spent: dict[str, float] = {}
    last = ["reading", time.perf_counter()]

    def progress(_: float, stage: str) -> None:
        now = time.perf_counter()
        spent[last[0]] = spent.get(last[0], 0) + now - last[1]
        last[:] = [stage, now]

    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "mesh.ply"
        giant.write(giant.terrain(triangles, seed=1), mesh)
        last[1] = time.perf_counter()
        wall, busy = time.perf_counter(), time.process_time()
        report = umbel.build_asset(
            mesh,
            "memory://asset.umbel",
            work="memory://work",
            unit_triangles=triangles // 8,
            executor=InProcess(),
            progress=progress,
            threads=1,
        )
        progress(1, "end")
        # Others may use the machine.
        own = (time.process_time() - busy) / (time.perf_counter() - wall)
    total = report["input_triangles"]
    units = report["units"]
    built = sum(u["build_seconds"] for u in units)
    first = [u for u in units if u["tier"] == 0]
    tiers = sum(v for k, v in spent.items() if k.startswith("tier"))
    passes = sum(spent.get(k, 0) for k in ("reading", "dividing", "sorting"))
    writing = sum(spent.values()) - tiers - passes - spent.get("planning", 0)
    per = 1e6 / total * min(1.0, own)
    return {
        "passes_us": passes * per,
        "first_us": sum(u["build_seconds"] for u in first) * per,
        "units_us": built * per,
        "writing_us": writing * per,
        "planning_us": spent.get("planning", 0) * per,
        "routed_bytes": sum(u["fetch_bytes"] for u in first) / total,
        "fetch_bytes": sum(u["fetch_bytes"] for u in units) / total,
        "store_bytes": sum(u["store_bytes"] for u in units) / total,
        "asset_bytes": report["file_bytes"] / total,
    }


def simulate(
    triangles: float, workers: int, cost: dict[str, float], network: float
) -> tuple[float, float, float]:
    """Seconds of a build: of the driver alone, of units, and of the network where it is waited
    for. `network`: bytes a second of each machine; of 16 workers a machine."""
    driver = cost["passes_us"] * 1e-6 * triangles / _DRIVER_CORES
    # What is sorted goes out while more is sorted.
    sent = cost["routed_bytes"] * triangles / network
    waits = max(0.0, sent - driver * 0.4)
    units_seconds, left, tier = 0.0, triangles, 0
    chance = random.Random(1)
    # Tiers leave a quarter each; their cost a triangle is the same but for the first's.
    later = (cost["units_us"] - cost["first_us"]) * 0.75 / 0.25
    share = [cost["first_us"], later]
    while True:
        count = max(1, round(left / (UNIT * _FILL)))
        each = share[min(tier, 1)] * 1e-6 * left / count
        moved = (cost["fetch_bytes"] + cost["store_bytes"]) * 0.75 * left / count
        seconds = _schedule(
            count, workers, each + _START + moved / (network / min(16, workers)), chance
        )
        # What units leave goes to the driver, which is one machine.
        arrives = cost["store_bytes"] * 0.75 * left / network
        waits += max(0.0, arrives - seconds)
        units_seconds += seconds
        if count == 1:
            break
        left, tier = left / 4, tier + 1
        # The barrier: exits are read, divided and sorted by the driver, and sent.
        barrier = cost["planning_us"] * 1e-6 * left * 4 + cost["passes_us"] * 0.3e-6 * left
        driver += barrier / 4
        waits += cost["routed_bytes"] * 3 * left / network
    driver += cost["writing_us"] * 1e-6 * triangles / _DRIVER_CORES
    waits += cost["asset_bytes"] * triangles / network
    return driver, units_seconds, waits


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
    print("| triangles | workers | s | speed-up | units | driver | network |")
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
