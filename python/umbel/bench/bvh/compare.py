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
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.accel.bvh import Bvh, Bvh2, build_bvh2, builders
from umbel.accel.kdtree import KdTree
from umbel.accel.queries import TriangleQueries
from umbel.accel.uniform import IntervalHierarchy, TwoLevelGrid
from umbel.bench import charts
from umbel.bench.bvh import charts as bvh_charts
from umbel.bench.bvh import kmeans as bvh_kmeans
from umbel.bench.bvh.paths import HEIGHT, WIDTH, View, path_view, sketch, trace
from umbel.bench.bvh.plant import plant
from umbel.bench.bvh.scenes import COSTS, GENERATED, Kmeans, Scene, scene
from umbel.bench.table import Column, Row, csv_text, geometric_means, markdown
from umbel.bench.timing import Machine, Span, Timed, Timing, cores, take_turns, this_machine
from umbel.errors import Error
from umbel.geometry.mesh import Mesh
from umbel.geometry.repair import Progress

BASELINE = "sweep"
LQ, HQ = 8, 128
LARGE = 2_000_000
"""Triangles; of larger scenes EPO would take longer than all the rest, and builds run once."""
PARTS = ("builders", "stages", "iterations")
PUBLISHED = {
    "kmeans": ("kmeans 2016", bvh_kmeans.PUBLISHED),
    "ploc": ("ploc 2018", {"ploc_sweep": 0}),
    "atrbvh": ("atrbvh 2015", {"atrbvh_bits": 0}),
}
"""Builders whose defaults differ from their papers: what they are called with the papers' settings,
and those."""

RATIOS = ("sah_ratio", "epo_ratio", "speed_ratio", "lq_ratio", "hq_ratio")
COLUMNS = [
    Column("scene", "scene"),
    Column("width", "width", "d"),
    Column("builder", "builder"),
    Column("build_seconds", "build s", ".3f"),
    Column("mtriangles_per_second", "M tri/s", ".2f"),
    Column("sah_cost", "SAH", ".1f"),
    Column("epo", "EPO", ".2f"),
    Column("mrays_per_second", "M rays/s", ".2f"),
    Column("lq_seconds", "LQ s", ".2f"),
    Column("hq_seconds", "HQ s", ".2f"),
    Column("sah_ratio", "SAH ratio", ".3f"),
    Column("epo_ratio", "EPO ratio", ".2f"),
    Column("speed_ratio", "speed ratio", ".3f"),
    Column("lq_ratio", "LQ ratio", ".3f"),
    Column("hq_ratio", "HQ ratio", ".3f"),
]
MEANS = [
    Column("width", "width", "d"),
    Column("builder", "builder"),
    Column("mtriangles_per_second", "M tri/s", ".2f"),
    *[column for column in COLUMNS if column.field in RATIOS],
]
CHEAPEST = [
    Column("scene", "scene"),
    Column("width", "width", "d"),
    Column("builder", "builder"),
    Column("from_samples", "from samples a pixel", ".3g"),
    Column("from_mrays", "from M rays", ".3g"),
]


@dataclass(frozen=True)
class Method:
    """A way to build a tree."""

    name: str
    arguments: Mapping[str, Any]
    """For `umbel.Bvh`."""


def methods(kmeans: Kmeans, only: Sequence[str] = ()) -> list[Method]:
    """Every builder that there is, the full sweep first; those in `PUBLISHED` also so; and the
    preset `best`. With `only` the full sweep and those of these names."""
    found = []
    for name in sorted(builders(), key=lambda name: name != BASELINE):
        own = {"builder": name, **(kmeans.arguments() if name == "kmeans" else {})}
        if name in PUBLISHED:
            published, settings = PUBLISHED[name]
            found.append(Method(published, {**own, **settings}))
        found.append(Method(name, own))
    found.append(Method("best", {"builder": "best"}))
    names = [*(method.name for method in found), *STRUCTURES]
    unknown = [name for name in only if name not in names]
    if unknown:
        raise Error(f"there is no builder {unknown[0]!r} to compare, only {', '.join(names)}")
    return [m for m in found if not only or m.name == BASELINE or m.name in only]


STRUCTURES: Mapping[str, Callable[..., TriangleQueries]] = {
    "kdtree": KdTree,
    "kdtree ropes": partial(KdTree, ropes=True),
    "kdtree binned": partial(KdTree, builder="binned"),
    "grid": TwoLevelGrid,
    "bih": IntervalHierarchy,
}
"""What is compared besides hierarchies: the same for all widths."""


def compared_structures(only: Sequence[str] = ()) -> dict[str, Callable[..., TriangleQueries]]:
    """All of them, or those of these names."""
    return {name: make for name, make in STRUCTURES.items() if not only or name in only}


TREE_FIELDS = ("nodes", "leaves", "max_depth", "references", "sah_cost", "bytes")


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    runs: int = 3
    """Medians of so many."""
    samples: int = 1
    """Paths a pixel."""
    share: float = 0.05
    """Of each picture's tiles."""
    widths: Sequence[int] = (2, 8)
    """Children a node of what is traced."""
    threads: int = 0
    parts: Sequence[str] = PARTS
    """What is compared: the builders, the stages of k-means, its iterations."""
    builders: Sequence[str] = ()
    """Those that are compared with the full sweep; none: all."""

    def build_runs(self, mesh: Mesh) -> int:
        """How often each tree is built."""
        return 1 if len(mesh.triangles) > LARGE else self.runs


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
    sketches: dict[str, NDArray[np.uint8]] = field(default_factory=dict)
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


def generated(triangles: int) -> dict[str, Callable[[], Mesh]]:
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
            found.sketches[name] = _sketches(on, trees[0].result, threads)
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


def _sketches(on: Scene, tree: Bvh2, threads: int) -> NDArray[np.uint8]:
    bvh = Bvh.from_tree(tree, on.mesh, threads=threads)
    return np.hstack([sketch(bvh, on.mesh, camera) for camera in on.cameras])


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


def normalised(rows: Sequence[Row]) -> list[Row]:
    """The rows with their total times, and with ratios to the full sweep of the same scene and
    width, whose build counts as nothing."""
    swept = {(row["scene"], row["width"]): row for row in rows if row["builder"] == BASELINE}
    found = []
    for row in rows:
        to = swept[row["scene"], row["width"]]
        made = row["build_seconds"] + row["widen_seconds"]
        found.append(
            {
                **row,
                "lq_seconds": made + LQ * row["sample_seconds"],
                "hq_seconds": made + HQ * row["sample_seconds"],
                "sah_ratio": _ratio(row["sah_cost"], to["sah_cost"]),
                "epo_ratio": _ratio(row["epo"], to["epo"]),
                "speed_ratio": row["mrays_per_second"] / to["mrays_per_second"],
                "lq_ratio": _total_ratio(row, to, LQ),
                "hq_ratio": _total_ratio(row, to, HQ),
            }
        )
    return found


def _ratio(value: float | None, to: float | None) -> float | None:
    return value / to if value is not None and to else None


def _total_ratio(row: Row, to: Row, samples: int) -> float:
    # The idealised sweep is not slowed down by its build; that of the row's own sweep is.
    made = 0.0 if row is to else row["build_seconds"] + row["widen_seconds"]
    ratio: float = (made + samples * row["sample_seconds"]) / (samples * to["sample_seconds"])
    return ratio


def cheapest(rows: Sequence[Row]) -> list[Row]:
    """For each scene and width the builders that make a picture soonest for some number of samples
    a pixel, and from which number, and how many rays, on: the lower envelope of
    build + samples * trace."""
    groups: dict[tuple[str, int], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["scene"], row["width"]), []).append(row)
    found = []
    for (name, width), group in groups.items():
        lines = [
            (row["build_seconds"] + row["widen_seconds"], row["sample_seconds"], row["builder"])
            for row in group
        ]
        start, best = 0.0, min(lines)
        while True:
            found.append(
                {
                    "scene": name,
                    "width": width,
                    "builder": best[2],
                    "from_samples": start,
                    "from_mrays": start * group[0]["sample_rays"] * 1e-6,
                }
            )
            later = [
                ((line[0] - best[0]) / (best[1] - line[1]), line[1], line)
                for line in lines
                if line[1] < best[1]
            ]
            if not later:
                break
            start, _, best = min(later)
    return found


def _legend(effort: Effort) -> str:
    how = (
        "One thread, timed by the processor time that it used."
        if effort.threads == 1
        else f"{effort.threads or cores()} threads, timed by the wall clock."
    )
    parts = [
        f"{how} Medians of {effort.runs} runs that took turns; scenes of over {LARGE:,} triangles "
        f"are built once, and their EPO is left out. At most 8 triangles a leaf, costs "
        f"{COSTS[0]:g} and {COSTS[1]:g}."
    ]
    if "builders" in effort.parts:
        share = "" if effort.share >= 1 else f" in {effort.share:.3g} of the pictures' tiles"
        paths = "1 path" if effort.samples == 1 else f"{effort.samples} paths"
        parts += [
            f"Three views of {WIDTH} x {HEIGHT}, two shadow rays at each hit. {paths} a pixel"
            f"{share} were traced; the total times, those of one picture with {LQ} (LQ) and {HQ} "
            "(HQ) samples a pixel, are extrapolated from that: build, widening and tracing. Width: "
            "children a node of what is traced.",
            "Ratios are to the full sweep of the same width with zero build time: for speed more "
            "is better, for the others less.",
        ]
    return "\n\n".join(parts)


def report(found: Comparison) -> str:
    """The comparison as a Markdown document."""
    machine = "\n".join(found.machine.sentences())
    parts = ["# Builders of hierarchies", machine, _legend(found.effort)]
    for name, kmeans in found.settings.items():
        rows = [row for row in found.rows if row["scene"] == name]
        if rows:
            parts += [
                f"## {name}",
                f"{rows[0]['triangles']:,} triangles; k-means with {kmeans}.",
                markdown(COLUMNS[1:], rows).rstrip(),
            ]
    if found.rows:
        parts += [
            "## Geometric means over the scenes",
            markdown(MEANS, found.means).rstrip(),
            "## Which builder for how many samples",
            "The builder that makes one picture soonest from so many samples, or rays, on.",
            markdown(CHEAPEST, found.cheapest).rstrip(),
        ]
    for title, columns, rows in (
        ("k-means by stage", bvh_kmeans.STAGES, found.stages),
        ("SAH cost of k-means after iterations", bvh_kmeans.ITERATIONS, found.iterations),
    ):
        if rows:
            parts += [f"## {title}", markdown(columns, rows).rstrip()]
    return "\n\n".join(parts) + "\n"


def write(found: Comparison, folder: Path) -> list[Path]:
    """Writes the tables, and charts if matplotlib is there; the files written."""
    from umbel.io.files import write_all

    tables = {
        "bvh.csv": found.rows,
        "bvh_cheapest.csv": found.cheapest,
        "bvh_stages.csv": found.stages,
        "bvh_iterations.csv": found.iterations,
    }
    texts = {"bvh.md": report(found)}
    texts |= {name: csv_text(rows) for name, rows in tables.items() if rows}
    for name, text in texts.items():
        write_all(folder / name, [text.encode()])
    written = [folder / name for name in texts]
    if not charts.available():
        return written
    drawn = bvh_charts.draw(folder, found.rows, found.stages, found.iterations)
    return written + drawn + bvh_charts.save_sketches(folder, found.sketches)
