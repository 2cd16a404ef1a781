"""Builders of hierarchies side by side, as Meister & Bittner compared them in 2016: what a tree
costs to build, how fast rays pass through it, and what that makes together.

Each builder's binary tree is widened in the same way and traced by the same code with the same
rays: path tracing of three views. All is normalised to the full sweep with zero build time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.accel.bvh import Bvh
from umbel.accel.queries import TriangleQueries
from umbel.accel.trees import Bvh2, build_bvh2
from umbel.bench.bvh import kmeans as bvh_kmeans
from umbel.bench.bvh.columns import MEANS
from umbel.bench.bvh.methods import LARGE, PARTS, Effort, Method, compared_structures, methods
from umbel.bench.bvh.paths import HEIGHT, WIDTH, View, path_view, preview, trace
from umbel.bench.bvh.plant import plant
from umbel.bench.bvh.scenes import COSTS, GENERATED, Kmeans, Scene, scene
from umbel.bench.bvh.totals import cheapest, normalised
from umbel.bench.table import Row, geometric_means
from umbel.bench.timing import Machine, Span, Timed, Timing, take_turns, this_machine
from umbel.errors import Error
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
            "machine": self.machine.fields(),
        }


def generated_scene(triangles: int) -> dict[str, Callable[[], Mesh]]:
    """The scene that is made here, and needs no file."""
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
        on = scene(name, load, kmeans, effort.threads)
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
    unknown = [part for part in parts if part not in PARTS]
    if unknown or not parts:
        raise Error(f"parts must be of {', '.join(PARTS)}, not {', '.join(unknown) or 'nothing'}")
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
    views = _views(on, trees[0], effort)
    traced: list[Row] = []
    for number, width in enumerate(effort.widths):
        part = report.part(*(0.2 + 0.8 * (number + k) / len(effort.widths) for k in (0, 1)))
        measured = _traced(on.mesh, trees, structures, views, width, effort, part)
        traced += [{**row, **extra} for row, extra in zip(rows, measured, strict=True)]
    return normalised(traced)


def _views(on: Scene, tree: Bvh2, effort: Effort) -> list[View]:
    """The rays, found with any tree."""
    bvh = Bvh.from_tree(tree, on.mesh, threads=effort.threads)
    return [
        path_view(
            bvh,
            on.mesh,
            camera,
            samples=effort.samples,
            share=effort.share,
            seed=number + 1,
            threads=effort.threads,
        )
        for number, camera in enumerate(on.cameras)
    ]


def _previews(on: Scene, tree: Bvh2, threads: int) -> NDArray[np.uint8]:
    bvh = Bvh.from_tree(tree, on.mesh, threads=threads)
    return np.hstack([preview(bvh, on.mesh, camera) for camera in on.cameras])


def clock_of(threads: int) -> Callable[[], float]:
    """Of one thread the processor time counts, of several the wall clock's."""
    return time.thread_time if threads == 1 else time.perf_counter


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


def _traced(
    mesh: Mesh,
    trees: Sequence[Bvh2],
    structures: Sequence[TriangleQueries],
    views: Sequence[View],
    width: int,
    effort: Effort,
    report: Span,
) -> list[Row]:
    """What tracing adds to the row of each tree."""
    clock = clock_of(effort.threads)
    traced: list[TriangleQueries] = []
    widen_seconds = []
    for tree in trees:
        began = clock()
        traced.append(Bvh.from_tree(tree, mesh, width=width, threads=effort.threads))
        widen_seconds.append(clock() - began)
    traced += structures
    widen_seconds += [0.0] * len(structures)

    def work(structure: TriangleQueries, view: View) -> tuple[None, float]:
        began = clock()
        trace(structure, view, effort.threads)
        return None, clock() - began

    entries = [
        Timed(f"tracing view {number + 1}, width {width}", partial(work, structure, view))
        for structure in traced
        for number, view in enumerate(views)
    ]
    seconds = [timing.seconds for timing in take_turns(entries, effort.runs, report)]
    rows = []
    for index, (structure, widening) in enumerate(zip(traced, widen_seconds, strict=True)):
        own = seconds[index * len(views) : (index + 1) * len(views)]
        rows.append(
            {
                "width": width,
                "wide_bytes": structure.statistics()["bytes"],
                "widen_seconds": widening,
                **trace_figures(own, views),
            }
        )
    return rows


def trace_figures(seconds: Sequence[float], views: Sequence[View]) -> Row:
    """Rays a second, and the seconds and rays of one sample of every pixel of a picture, means
    over the views."""
    rays = sum(view.rays for view in views)
    pixels = WIDTH * HEIGHT
    return {
        "rays": rays,
        "mrays_per_second": rays / sum(seconds) * 1e-6,
        **{
            f"view{number + 1}_mrays_per_second": view.rays / own * 1e-6
            for number, (own, view) in enumerate(zip(seconds, views, strict=True))
        },
        "sample_seconds": fmean(
            own / view.paths * pixels for own, view in zip(seconds, views, strict=True)
        ),
        "sample_rays": fmean(view.rays / view.paths * pixels for view in views),
    }
