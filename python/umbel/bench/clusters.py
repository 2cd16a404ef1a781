"""Clusters of triangles: Umbel's presets and the Morton order beside meshoptimizer.

Every method makes clusters of at most 128 triangles. Seconds are taken in C++ around the build
alone, on meshes that are welded first.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel, shapes
from umbel.bench import charts
from umbel.bench.peers import peers
from umbel.bench.table import Row, columns, csv_text, geometric_means, markdown, write_tables
from umbel.bench.timing import Machine, Span, Timed, cores, take_turns, this_machine
from umbel.errors import Error
from umbel.geometry.arrays import native
from umbel.geometry.mesh import Mesh
from umbel.geometry.repair import Progress, validate, weld

MAX_TRIANGLES = 128
BASELINE = "quality" if peers is None else "meshoptimizer Spatial v128"
"""The method that speed ratios refer to."""

COLUMNS = columns(
    """
    mesh                  | mesh
    triangles             | triangles   | ,d
    method                | method
    threads               | threads     | d
    seconds               | seconds     | .4f
    mtriangles_per_second | M/s         | .2f
    ratio                 | speed ratio | .2f
    mean_fill             | fill        | .3f
    mean_vertices         | vertices    | .1f
    surface_area_ratio    | area ratio  | .3f
    sah                   | SAH         | .1f
    overlap               | overlap     | .3f
    """
)
MEANS = [column for column in COLUMNS[2:] if column.field not in ("threads", "seconds")]
METRICS = ("clusters", "mean_fill", "mean_vertices", "surface_area_ratio", "sah", "overlap")
LEGEND = (
    f"Clusters of at most {MAX_TRIANGLES} triangles. Speed ratio: to `{BASELINE}`. One thread is "
    "timed by the processor time that it used, several by the wall clock; medians of runs that "
    "took turns. Vertices: unique ones a cluster. v128, v256: the most vertices a cluster may have."
)

Made = tuple[NDArray[np.uint32], NDArray[np.uint32]]
"""Items in cluster order, and offset and count of each cluster."""


@dataclass(frozen=True)
class Method:
    """A way to cluster: from a mesh's arrays to items, ranges and seconds."""

    name: str
    threads: int
    make: Callable[[_umbel.MeshArrays], tuple[NDArray[np.uint32], NDArray[np.uint32], float]]

    def timed(self, arrays: _umbel.MeshArrays) -> tuple[Made, float]:
        items, ranges, seconds = self.make(arrays)
        return (items, ranges), seconds


@dataclass
class Comparison:
    """What `compare` found."""

    machine: Machine
    rows: list[Row]
    """One for each mesh and method."""
    frontier: list[Row] = field(default_factory=list)
    """Fill and area of each mesh, for several weights of fill."""

    @property
    def means(self) -> list[Row]:
        """Geometric means over the meshes, a row for each method."""
        fields = [column.field for column in MEANS[1:]]
        return geometric_means(self.rows, "method", fields)

    def fields(self) -> dict[str, Any]:
        """All of it, for JSON."""
        return {
            "rows": self.rows,
            "means": self.means,
            "frontier": self.frontier,
            "machine": self.machine.fields(),
        }


def methods(threads: int = 0) -> list[Method]:
    """All that is compared; `threads` (0: all cores) is for the method on several threads."""
    many = threads or cores()

    def ours(name: str, preset: str, threads: int = 1, **changes: Any) -> Method:
        return Method(
            name,
            threads,
            partial(_umbel.timed_cluster_mesh, config=_config(preset, **changes), threads=threads),
        )

    found = [ours("quality", "quality"), ours("quality v128", "quality", max_vertices=128)]
    if many > 1:
        found.append(ours(f"quality, {many} threads", "quality", many))
    return [
        *found,
        ours("fast", "fast"),
        ours("exact", "exact"),
        Method(
            "Morton",
            1,
            partial(_umbel.timed_cluster_mesh, config=_config("quality"), morton=True, threads=1),
        ),
        *_meshoptimizer(),
    ]


def _meshoptimizer() -> list[Method]:
    """Its methods, where it is built in."""
    if peers is None:
        return []
    spatial, flex = peers.meshlets_spatial, peers.meshlets_flex
    return [
        Method("meshoptimizer Spatial v128", 1, partial(spatial, max_vertices=128)),
        Method("meshoptimizer Spatial v256", 1, partial(spatial, max_vertices=256)),
        Method("meshoptimizer Flex v128", 1, partial(flex, max_vertices=128)),
    ]


def _config(preset: str, **changes: Any) -> _umbel.ClusterConfig:
    config = _umbel.cluster_preset(preset, MAX_TRIANGLES)
    for name, value in changes.items():
        setattr(config, name, value)
    return config


PROCEDURAL: dict[str, Callable[[], Mesh]] = {
    "blob": lambda: shapes.blob(6),
    "terrain": lambda: shapes.terrain(256, 256),
    "soup": lambda: shapes.soup(60_000),
}
"""The meshes to compare on where none are given."""


def compare(
    meshes: Mapping[str, Callable[[], Mesh]],
    *,
    runs: int = 5,
    frontier: bool = False,
    progress: Progress | None = None,
    threads: int = 0,
) -> Comparison:
    """Times all methods on meshes, which are loaded one at a time, and with `frontier` builds
    clusters for several weights of fill too. A `progress` that returns False cancels."""
    found = Comparison(this_machine(), [])
    for number, (name, load) in enumerate(meshes.items()):
        mesh = load()
        validate(mesh, threads=threads)
        welded = weld(mesh, threads=threads)
        if not len(welded.triangles):
            raise Error(f"{name} has no triangles to cluster")
        arrays = native(welded)
        part = Span(progress, name, number / len(meshes), (number + 1) / len(meshes))
        found.rows += _rows(name, arrays, len(welded.triangles), runs, part, threads)
        if frontier:
            found.frontier += _frontier(name, arrays, threads)
    return found


def _rows(
    name: str,
    arrays: _umbel.MeshArrays,
    triangles: int,
    runs: int,
    report: Callable[[float, str], None],
    threads: int,
) -> list[Row]:
    compared = methods(threads)
    timings = take_turns([Timed(m.name, partial(m.timed, arrays)) for m in compared], runs, report)
    by_name = {m.name: timing.seconds for m, timing in zip(compared, timings, strict=True)}
    rows = []
    for method, timing in zip(compared, timings, strict=True):
        metrics = _metrics(arrays, timing.result, threads)
        rows.append(
            {
                "mesh": name,
                "triangles": triangles,
                "method": method.name,
                "threads": method.threads,
                "seconds": timing.seconds,
                "mtriangles_per_second": triangles / timing.seconds * 1e-6,
                "ratio": by_name[BASELINE] / timing.seconds,
                **{key: metrics[key] for key in METRICS},
            }
        )
    return rows


def _metrics(arrays: _umbel.MeshArrays, made: Made, threads: int) -> dict[str, Any]:
    return _umbel.mesh_cluster_metrics(arrays, *made, MAX_TRIANGLES, threads=threads)


def _frontier(name: str, arrays: _umbel.MeshArrays, threads: int) -> list[Row]:
    """Fill against area: each library's own penalty for low fill, from none to high."""
    rows = []
    for weight in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        ours = _umbel.timed_cluster_mesh(
            arrays, _config("quality", min_items=32, underfill_cost=weight), threads=threads
        )
        made_by = {"quality": ours}
        if peers is not None:
            theirs = peers.meshlets_spatial(arrays, max_vertices=256, fill_weight=weight)
            made_by["meshoptimizer Spatial v256"] = theirs
        for method, made in made_by.items():
            metrics = _metrics(arrays, made[:2], threads)
            rows.append(
                {
                    "mesh": name,
                    "method": method,
                    "fill_weight": weight,
                    "mean_fill": metrics["mean_fill"],
                    "surface_area_ratio": metrics["surface_area_ratio"],
                }
            )
    return sorted(rows, key=lambda row: row["method"])


def report(found: Comparison) -> str:
    """The comparison as a Markdown document."""
    return "\n\n".join(
        [
            "# Clusters",
            "\n".join(found.machine.sentences()),
            LEGEND,
            markdown(COLUMNS, found.rows).rstrip(),
            "Geometric means over the meshes:",
            markdown(MEANS, found.means),
        ]
    )


def write(found: Comparison, folder: Path) -> list[Path]:
    """Writes the tables, and charts if matplotlib is there; the files written."""
    tables = {"clusters.md": report(found), "clusters.csv": csv_text(found.rows)}
    if found.frontier:
        tables["clusters_frontier.csv"] = csv_text(found.frontier)
    written = write_tables(folder, tables)
    return written + (_charts(found, folder) if charts.available() else [])


def _charts(found: Comparison, folder: Path) -> list[Path]:
    meshes = list(dict.fromkeys(row["mesh"] for row in found.rows))
    written = []
    for mesh in meshes:
        path = folder / f"clusters_{re.sub(r'[^A-Za-z0-9._-]', '_', mesh)}.png"
        speed = _panel(mesh, found.rows, "mtriangles_per_second", "surface_area_ratio")
        charts.draw(path, [speed], "million triangles/s", "surface-area ratio", log_x=True)
        written.append(path)
    if found.frontier:
        path = folder / "clusters_frontier.png"
        panels = [_panel(m, found.frontier, "mean_fill", "surface_area_ratio") for m in meshes]
        charts.draw(path, panels, "fill", "surface-area ratio")
        written.append(path)
    return written


def _panel(mesh: str, rows: Sequence[Row], x: str, y: str) -> charts.Panel:
    """A mesh's rows as points, a series for each method."""
    series: dict[str, list[Row]] = {}
    for row in rows:
        if row["mesh"] == mesh:
            series.setdefault(row["method"], []).append(row)
    return charts.Panel(
        mesh,
        [
            charts.Series(
                method,
                [row[x] for row in points],
                [row[y] for row in points],
                ours=not method.startswith("meshoptimizer"),
            )
            for method, points in series.items()
        ],
    )
