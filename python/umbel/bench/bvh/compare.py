"""Builders of hierarchies side by side, as Meister & Bittner compared them in 2016: what a tree
costs to build, how fast rays pass through it, and what that makes together.

Each builder's binary tree is widened in the same way and traced by the same code with the same
rays: path tracing of three views. All is normalised to the full sweep with zero build time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.accel.bvh import Bvh
from umbel.accel.queries import TriangleQueries
from umbel.accel.trees import Bvh2, build_bvh2
from umbel.bench.bvh import kmeans as bvh_kmeans
from umbel.bench.bvh.columns import MEANS
from umbel.bench.bvh.methods import LARGE, PARTS, Effort, Method, compared_structures, methods
from umbel.bench.bvh.paths import preview
from umbel.bench.bvh.plant import check_triangles, plant
from umbel.bench.bvh.scenes import COSTS, GENERATED, Kmeans, Scene, scene
from umbel.bench.bvh.totals import cheapest, normalised
from umbel.bench.bvh.tracing import clock_of, trace_pictures
from umbel.bench.table import Row, geometric_means
from umbel.bench.timing import Machine, Span, Timed, Timing, take_turns, this_machine
from umbel.geometry.mesh import Mesh
from umbel.geometry.repair import Progress

TREE_FIELDS = ("nodes", "leaves", "max_depth", "references", "sah_cost", "bytes")


@dataclass
class Comparison:
    """What `compare` found."""

    machine: Machine
    effort: Effort
    settings: dict[str, str] = field(default_factory=dict)
    """Of k-means, a text for each scene."""
    rows: list[Row] = field(default_factory=list)
    """One for each scene, width and builder."""
    stages: list[Row] = field(default_factory=list)
    """Build time of k-means by stage."""
    iterations: list[Row] = field(default_factory=list)
    """SAH cost of k-means after some iterations."""
    previews: dict[str, NDArray[np.uint8]] = field(default_factory=dict)
    """Of each scene: what its views show, side by side, in grey."""

    @property
    def means(self) -> list[Row]:
        """Geometric means over the scenes, a row for each width and builder."""
        fields = [column.field for column in MEANS[2:]]
        return [
            {"width": width, **mean}
            for width in dict.fromkeys(row["width"] for row in self.rows)
            for mean in geometric_means(
                [row for row in self.rows if row["width"] == width], "builder", fields
            )
        ]

    @property
    def cheapest(self) -> list[Row]:
        """From how many samples a pixel on which builder makes a picture soonest."""
        return cheapest(self.rows)

    def fields(self) -> dict[str, Any]:
        """All of it, for JSON."""
        return {
            "rows": self.rows,
            "means": self.means,
            "cheapest": self.cheapest,
            "stages": self.stages,
            "iterations": self.iterations,
            "kmeans": self.settings,
            "samples": self.effort.samples,
            "share": self.effort.share,
            "resolution": list(self.effort.resolution),
            "machine": self.machine.fields(),
        }


def generated_scene(triangles: int) -> dict[str, Callable[[], Mesh]]:
    """The scene that is made here, and needs no file."""
    check_triangles(triangles)
    return {GENERATED: partial(plant, triangles)}


def compare(
    scenes: Mapping[str, Callable[[], Mesh]],
    effort: Effort | None = None,
    *,
    kmeans: Kmeans | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Compares all builders on each scene; `scenes` maps names to what loads them, and `kmeans`
    replaces the parameters that are known to suit them."""
    effort = effort or Effort()
    found = Comparison(this_machine(), effort)
    for number, (name, load) in enumerate(scenes.items()):
        report = Span(progress, name).part(number / len(scenes), (number + 1) / len(scenes))
        report(0.0, "loading")
        on = scene(name, load, kmeans, effort.threads, effort.resolution)
        found.settings[name] = str(on.kmeans)
        spans = _spans(report.part(0.02, 1.0), effort.parts)
        runs, threads = effort.build_runs(on.mesh), effort.threads
        if "builders" in spans:
            trees = _built(on, effort, spans["builders"].part(0.0, 0.4))
            others = _structures(on, effort, spans["builders"].part(0.4, 0.5))
            found.rows += _rows(on, trees, others, effort, spans["builders"].part(0.5, 1.0))
            found.previews[name] = _previews(on, trees[0].result, threads)
        if "stages" in spans:
            found.stages += bvh_kmeans.stage_rows(name, on.mesh, runs, spans["stages"])
        if "iterations" in spans:
            found.iterations += bvh_kmeans.iteration_rows(
                name, on.mesh, threads, spans["iterations"]
            )
    return found


def _spans(report: Span, parts: Sequence[str]) -> dict[str, Span]:
    """Shares of the progress for the parts that are asked for."""
    weights = {"builders": 7, "stages": 1, "iterations": 2}
    spans, done, total = {}, 0, sum(weights[part] for part in set(parts))
    for part in PARTS:
        if part in parts:
            spans[part] = report.part(done / total, (done + weights[part]) / total)
            done += weights[part]
    return spans


def _built(on: Scene, effort: Effort, report: Span) -> list[Timing[Bvh2]]:
    """The tree of each method."""
    clock = clock_of(effort.threads)
    return take_turns(
        [
            Timed(f"building {method.name}", partial(_build, on.mesh, method, effort, clock))
            for method in methods(on.kmeans, effort.builders)
        ],
        effort.build_runs(on.mesh),
        report,
    )


def _structures(on: Scene, effort: Effort, report: Span) -> list[Timing[TriangleQueries]]:
    """What is not a hierarchy."""
    clock, threads = clock_of(effort.threads), effort.threads

    def work(make: Callable[..., TriangleQueries]) -> tuple[TriangleQueries, float]:
        began = clock()
        structure = make(on.mesh, cost=COSTS, threads=threads)
        return structure, clock() - began

    entries = [
        Timed(f"building {name}", partial(work, make))
        for name, make in compared_structures(effort.builders).items()
    ]
    return take_turns(entries, effort.build_runs(on.mesh), report)


def _rows(
    on: Scene,
    built: Sequence[Timing[Bvh2]],
    others: Sequence[Timing[TriangleQueries]],
    effort: Effort,
    report: Span,
) -> list[Row]:
    rows = []
    for number, (method, timing) in enumerate(
        zip(methods(on.kmeans, effort.builders), built, strict=True)
    ):
        report(0.2 * number / len(built), f"measuring {method.name}")
        rows.append(_tree_row(on, method.name, timing.result, timing.seconds, effort.threads))
    for name, other in zip(compared_structures(effort.builders), others, strict=True):
        statistics = other.result.statistics()
        found = {field: statistics[field] for field in TREE_FIELDS} | {"epo": None}
        rows.append(_row(on, name, found, other.seconds))
    trees = [timing.result for timing in built]
    structures = [timing.result for timing in others]
    traced: list[Row] = []
    for number, width in enumerate(effort.widths):
        part = report.part(*(0.2 + 0.8 * (number + k) / len(effort.widths) for k in (0, 1)))
        measured = trace_pictures(on, trees, structures, width, effort, part)
        traced += [{**row, **extra} for row, extra in zip(rows, measured, strict=True)]
    return normalised(traced)


def _previews(on: Scene, tree: Bvh2, threads: int) -> NDArray[np.uint8]:
    bvh = Bvh.from_tree(tree, on.mesh, threads=threads)
    return np.hstack([preview(bvh, on.mesh, camera) for camera in on.cameras])


def _build(
    mesh: Mesh, method: Method, effort: Effort, clock: Callable[[], float]
) -> tuple[Bvh2, float]:
    began = clock()
    tree = build_bvh2(mesh, cost=COSTS, threads=effort.threads, **method.arguments)
    return tree, clock() - began


def _tree_row(on: Scene, builder: str, tree: Bvh2, seconds: float, threads: int) -> Row:
    epo = tree.epo(COSTS, threads=threads) if len(on.mesh.triangles) <= LARGE else None
    return _row(on, builder, {**tree.statistics(COSTS), "epo": epo}, seconds)


def _row(on: Scene, builder: str, found: Mapping[str, Any], seconds: float) -> Row:
    triangles = len(on.mesh.triangles)
    return {
        "scene": on.name,
        "triangles": triangles,
        "builder": builder,
        "kmeans": str(on.kmeans) if builder.startswith("kmeans") else None,
        "build_seconds": seconds,
        "mtriangles_per_second": triangles / seconds * 1e-6,
        **found,
    }
