"""What the kernels of device code take, by Nsight Compute: a page of tables.

    ncu --csv --page details --print-units base --section SpeedOfLight --section Occupancy \\
      --section WarpStateStats --log-file lbvh.csv cuda_bvh_bench --runs 1 --builder lbvh MESH.ply
    python bench/device_profile.py PAGE.md lbvh.csv ...       a table for each, by its file's name

Launches of one kernel are added up; their rates are means by time.
"""

from __future__ import annotations

import csv
import re
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

from docs_tables import table

COLUMNS = {
    "threads an instruction": "Avg. Active Threads Per Warp",
    "warps there, %": "Achieved Occupancy",
    "instructions, %": "Compute (SM) Throughput",
    "L1, %": "L1/TEX Cache Throughput",
    "L2, %": "L2 Cache Throughput",
    "memory, %": "DRAM Throughput",
}
INTRODUCTION = (
    "What kernels take, by Nsight Compute, on the device of the other pages of this name. Clocks "
    "are as they were, and caches are empty before each kernel, so times are a little longer than "
    'without a profiler. Of 32 threads of a warp, "threads an instruction" took part in the '
    'mean; "warps there" is the share of the warps that a multiprocessor could hold; the others '
    "are shares of the peak of instructions and of bandwidth."
)


def short(name: str) -> str:
    """A kernel by what it does, rather than by how it is started."""
    started = re.search(r"run_\w+<(.*)", name)
    inner = started[1] if started else name
    found = re.search(r"(?:\w+::)*(\w+)[<(>]", inner.removeprefix("void "))
    instance = re.search(r"\(instance (\d+)\)", name) if started else None
    return (found[1] if found else name) + (f" ({instance[1]})" if instance else "")


def kernels(file: Path) -> dict[str, list[Mapping[str, float]]]:
    """The launches of each kernel, in the order of their first ones."""
    text = file.read_text(encoding="utf-8")
    rows = csv.DictReader(text[text.index('"ID"') :].splitlines())
    launches: dict[str, dict[str, float]] = defaultdict(dict)
    names: dict[str, str] = {}
    for row in rows:
        names[row["ID"]] = short(row["Kernel Name"])
        if row["Metric Name"] in {"Duration", *COLUMNS.values()}:
            launches[row["ID"]][row["Metric Name"]] = float(row["Metric Value"].replace(",", ""))
    found: dict[str, list[Mapping[str, float]]] = defaultdict(list)
    for launch, name in names.items():
        found[name].append(launches[launch])
    return found


def rows_of(file: Path) -> list[list[str]]:
    """The longest first."""
    times = {name: sum(x["Duration"] for x in each) for name, each in kernels(file).items()}
    rows = []
    for name, each in sorted(kernels(file).items(), key=lambda item: -times[item[0]]):
        means = [
            sum(x[metric] * x["Duration"] for x in each) / times[name]
            for metric in COLUMNS.values()
        ]
        share = 100 * times[name] / sum(times.values())
        rows.append(
            [f"`{name}`", str(len(each)), f"{times[name] / 1000:.1f}", f"{share:.1f}"]
            + [f"{value:.1f}" for value in means]
        )
    return rows


def main(arguments: Sequence[str]) -> None:
    """Writes the page."""
    page, *files = map(Path, arguments)
    parts = [f"# {page.stem.removeprefix('gpu-')}", INTRODUCTION]
    for file in files:
        head = ["kernel", "launches", "µs", "% of all", *COLUMNS]
        parts += [f"## {file.stem.removeprefix('profile-')}", table(head, rows_of(file))]
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
