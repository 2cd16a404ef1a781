"""Builders of hierarchies compared on a CUDA device. The program cuda_bvh_bench measures; this
makes tables and charts of what it prints.

All is normalised to the full sweep with zero build time, as in compare.py. A sample is one ray
through each pixel of three pictures of 512 x 512, and one diffuse bounce from what it hits.

    python -m umbel.bench.bvh.cuda MEASURED.json FOLDER [NAME]     writes them without measuring
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from umbel.bench.table import (
    Column,
    Row,
    columns,
    csv_text,
    geometric_means,
    markdown,
    write_tables,
)
from umbel.errors import Error

BASELINE = "sweep"
LQ, HQ = 8, 128
RATIOS = ("sah_ratio", "speed_ratio", "lq_ratio", "hq_ratio")
COLUMNS = columns(
    """
    scene                 | scene
    builder               | builder
    build_ms              | build ms         | .3f
    mtriangles_per_second | M tri/s          | .1f
    refit_ms              | refit ms         | .3f
    sah                   | SAH              | .1f
    primary_mrays         | primary M rays/s | .1f
    bounce_mrays          | bounce M rays/s  | .1f
    lq_ms                 | LQ ms            | .2f
    hq_ms                 | HQ ms            | .2f
    sah_ratio             | SAH ratio        | .3f
    speed_ratio           | speed ratio      | .3f
    lq_ratio              | LQ ratio         | .3f
    hq_ratio              | HQ ratio         | .3f
    scratch_per_triangle  | scratch B/tri    | .0f
    nodes_per_triangle    | nodes B/tri      | .1f
    """
)
MEANS = [COLUMNS[1], COLUMNS[3], *(column for column in COLUMNS if column.field in RATIOS)]
NODE_BYTES = 80


@dataclass(frozen=True)
class DeviceComparison:
    """What was measured on one device."""

    device: str
    runs: int
    rows: list[Row]
    """One a scene and builder."""
    stages: list[Row]
    """Milliseconds of each stage of each build."""

    @property
    def means(self) -> list[Row]:
        """Geometric means over the scenes, a row a builder."""
        return geometric_means(self.rows, "builder", ["mtriangles_per_second", *RATIOS])

    def fields(self) -> dict[str, Any]:
        """All of it."""
        return {
            "device": self.device,
            "runs": self.runs,
            "builders": self.rows,
            "stages": self.stages,
            "means": self.means,
        }


def program() -> Path:
    """Where the measuring program is looked for."""
    built = Path(__file__).parents[4] / "build/release/bench/cuda_bvh_bench"
    return Path(os.environ.get("UMBEL_CUDA_BVH_BENCH", built))


def check_program() -> None:
    """Refuses to measure where the program is missing."""
    if not program().is_file():
        raise Error(
            f"measuring on a device needs the program cuda_bvh_bench, and there is no {program()}: "
            "`make cuda` builds it, and UMBEL_CUDA_BVH_BENCH says where it is"
        )


def measure(meshes: Sequence[Path], *, runs: int, builders: Sequence[str] = ()) -> DeviceComparison:
    """Runs the program over binary PLY files."""
    check_program()
    chosen = [name for name in builders if name != BASELINE]
    names = [
        word for name in ([*chosen, BASELINE] if chosen else []) for word in ("--builder", name)
    ]
    done = subprocess.run(
        [program(), "--runs", str(runs), *names, *meshes],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()
        raise Error(
            said[-1].removeprefix("cuda_bvh_bench: ")
            if said
            else f"cuda_bvh_bench ended with status {done.returncode}"
        )
    return compared(done.stdout)


def compared(measured: str) -> DeviceComparison:
    """What the program has printed, with ratios."""
    found = json.loads(measured)
    rows, stages = [], []
    for scene in found["scenes"]:
        own = [_row(scene, builder) for builder in scene["builders"]]
        base = next((row for row in own if row["builder"] == BASELINE), None)
        for row in own:
            row |= _ratios(row, base)
        rows += own
        stages += [
            {"scene": scene["scene"], "builder": builder["builder"], "stage": name, "ms": ms}
            for builder in scene["builders"]
            for name, ms in builder["stages"].items()
        ]
    return DeviceComparison(found["device"], found["runs"], rows, stages)


def _row(scene: dict[str, Any], builder: dict[str, Any]) -> Row:
    triangles, build = scene["triangles"], sum(builder["stages"].values())
    sample = builder["primary_ms"] + builder["bounce_ms"]
    scratch = builder["scratch_bytes"]
    return {
        "scene": scene["scene"],
        "triangles": triangles,
        "builder": builder["builder"],
        "build_ms": build,
        "mtriangles_per_second": triangles / build / 1e3,
        "refit_ms": builder["refit_ms"],
        "sah": builder["sah"],
        "primary_mrays": scene["primary_rays"] / builder["primary_ms"] / 1e3,
        "bounce_mrays": scene["bounce_rays"] / builder["bounce_ms"] / 1e3,
        "sample_ms": sample,
        "lq_ms": build + LQ * sample,
        "hq_ms": build + HQ * sample,
        "scratch_per_triangle": None if scratch is None else scratch / triangles,
        "nodes_per_triangle": NODE_BYTES * builder["nodes"] / triangles,
    }


def _ratios(row: Row, base: Row | None) -> Row:
    """Of a row to the sweep; None where the scene was too large for that."""
    if base is None:
        return dict.fromkeys(RATIOS)
    return {
        "sah_ratio": row["sah"] / base["sah"],
        "speed_ratio": base["sample_ms"] / row["sample_ms"],
        "lq_ratio": row["lq_ms"] / (LQ * base["sample_ms"]),
        "hq_ratio": row["hq_ms"] / (HQ * base["sample_ms"]),
    }


def stage_names(stages: Sequence[Row]) -> list[str]:
    """All stages, in an order in which every build has its own."""
    builds: dict[str, list[str]] = {}
    for row in stages:
        builds.setdefault(row["builder"], []).append(row["stage"])
    names: list[str] = []
    for own in builds.values():
        for number, name in enumerate(own):
            if name in names:
                continue
            later = [names.index(other) for other in own[number:] if other in names]
            names.insert(min(later, default=len(names)), name)
    return names


def stage_table(stages: Sequence[Row]) -> str:
    """Milliseconds, a row a builder and a column a stage."""
    names = stage_names(stages)
    columns = [Column("builder", "builder"), *(Column(name, name, ".3f") for name in names)]
    table: dict[str, Row] = {}
    for row in stages:
        table.setdefault(row["builder"], {"builder": row["builder"]})[row["stage"]] = row["ms"]
    return markdown(columns, table.values())


def report(found: DeviceComparison) -> str:
    """The comparison as a Markdown document."""
    parts = [
        f"# Builders of hierarchies on {found.device}",
        f"Medians of {found.runs} run{'s' * (found.runs > 1)} (of the sweep, at most 3), without "
        "copies to or from the device. A sample is one ray through each pixel of three pictures of "
        "512 x 512, "
        f"and one diffuse bounce from what it hits; LQ is a build and {LQ} samples, HQ one and "
        f"{HQ}. Ratios are to the full sweep with zero build time: SAH and total times are better "
        "below 1, speed above.",
    ]
    for scene in dict.fromkeys(row["scene"] for row in found.rows):
        rows = [row for row in found.rows if row["scene"] == scene]
        stages = [row for row in found.stages if row["scene"] == scene]
        parts += [
            f"## {scene}",
            f"{rows[0]['triangles']:,} triangles.",
            markdown(COLUMNS[1:], rows).rstrip(),
            "Milliseconds of each stage:",
            stage_table(stages).rstrip(),
        ]
    parts += ["## Geometric means over the scenes", markdown(MEANS, found.means).rstrip()]
    return "\n\n".join(parts) + "\n"


def write(found: DeviceComparison, folder: Path, name: str = "bvh_cuda") -> list[Path]:
    """Writes the tables, and charts if matplotlib is there; the files written."""
    from umbel.bench import charts

    texts = {
        f"{name}.md": report(found),
        f"{name}.csv": csv_text(found.rows),
        f"{name}_stages.csv": csv_text(found.stages),
    }
    written = write_tables(folder, texts)
    if charts.available():
        for scene in dict.fromkeys(row["scene"] for row in found.rows):
            path = folder / f"{name}_{''.join(c if c.isalnum() else '-' for c in scene)}.png"
            draw(path, found, scene)
            written.append(path)
    return written


def draw(path: Path, found: DeviceComparison, scene: str) -> None:
    """Stacked bars of the stages of each build, and bars of the ratios to the sweep."""
    from matplotlib.figure import Figure

    from umbel.replacing import replacing

    rows = [row for row in found.rows if row["scene"] == scene]
    # The sweep would hide all others.
    built = [row["builder"] for row in rows if row["builder"] != BASELINE] or [BASELINE]
    figure = Figure(figsize=(13, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    bottom = dict.fromkeys(built, 0.0)
    stages = [row for row in found.stages if row["scene"] == scene and row["builder"] in bottom]
    for name in stage_names(stages):
        ms = {row["builder"]: row["ms"] for row in stages if row["stage"] == name}
        heights = [ms.get(builder, 0.0) for builder in built]
        left.bar(built, heights, 0.7, list(bottom.values()), label=name)
        for builder, height in zip(built, heights, strict=True):
            bottom[builder] += height
    left.set_ylabel("build [ms]")
    left.tick_params(axis="x", rotation=40)
    left.legend(frameon=False)
    titles = {
        "speed_ratio": "trace speed",
        "sah_ratio": "SAH cost",
        "lq_ratio": "total time LQ",
        "hq_ratio": "total time HQ",
    }
    others = [row for row in rows if row["builder"] != BASELINE and row["sah_ratio"] is not None]
    room = 0.84 / max(len(others), 1)
    for number, row in enumerate(others):
        x = [group + (number - (len(others) - 1) / 2) * room for group in range(len(titles))]
        right.bar(
            x,
            [row[key] - 1 for key in titles],
            room * 0.9,
            1,
            label=row["builder"],
            color=f"C{number}" if number < 10 else "black",
        )
    right.axhline(1, color="black", linewidth=0.8)
    right.set_xticks(range(len(titles)), list(titles.values()))
    right.set_ylabel("relative to the full sweep\n(zero build time)")
    if others:
        figure.legend(*right.get_legend_handles_labels(), loc="outside right upper", frameon=False)
    for axes in (left, right):
        axes.set_axisbelow(True)
        axes.grid(axis="y", alpha=0.3)
    figure.suptitle(f"{scene}: {rows[0]['triangles']:,} triangles, {found.device}", fontsize=11)
    with replacing(path) as file:
        figure.savefig(file, format="png", dpi=100)


def main() -> None:
    """See the top."""
    measured, folder, *name = sys.argv[1:]
    write(compared(Path(measured).read_text(encoding="utf-8")), Path(folder), *name)


if __name__ == "__main__":
    main()
