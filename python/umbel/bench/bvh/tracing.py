"""Pictures traced through every structure: the same rays for all, by turns.

The rays of a picture with many samples a pixel would not fit into memory, so they are found and
traced in passes of a few samples each.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import fmean

from umbel.accel.bvh import Bvh
from umbel.accel.queries import TriangleQueries
from umbel.accel.trees import Bvh2
from umbel.bench.bvh.methods import Effort
from umbel.bench.bvh.paths import View, path_view, trace
from umbel.bench.bvh.scenes import Scene
from umbel.bench.table import Row
from umbel.bench.timing import Span, Timed, take_turns

PASS = 8
"""Samples a pixel that are traced at a time."""


@dataclass
class Tally:
    """What was traced of one view, and in how many seconds."""

    seconds: float = 0.0
    paths: int = 0
    rays: int = 0

    def add(self, seconds: float, view: View) -> None:
        """Counts a pass."""
        self.seconds += seconds
        self.paths += view.paths
        self.rays += view.rays


def passes(samples: int) -> list[int]:
    """The samples a pixel of each pass."""
    return [min(PASS, samples - first) for first in range(0, samples, PASS)]


def clock_of(threads: int) -> Callable[[], float]:
    """Of one thread the processor time counts, of several the wall clock's."""
    return time.thread_time if threads == 1 else time.perf_counter


def trace_pictures(
    on: Scene,
    trees: Sequence[Bvh2],
    structures: Sequence[TriangleQueries],
    width: int,
    effort: Effort,
    report: Span,
) -> list[Row]:
    """What tracing adds to the row of each tree, widened, and of each other structure. Rays of
    several passes are traced once each, those of one pass as often as is asked for."""
    clock = clock_of(effort.threads)
    traced: list[TriangleQueries] = []
    widen_seconds = []
    for tree in trees:
        began = clock()
        traced.append(Bvh.from_tree(tree, on.mesh, width=width, threads=effort.threads))
        widen_seconds.append(clock() - began)
    traced += structures
    widen_seconds += [0.0] * len(structures)

    tallies = [[Tally() for _ in on.cameras] for _ in traced]
    sampled = passes(effort.samples)
    for number, samples in enumerate(sampled):
        part = report.part(number / len(sampled), (number + 1) / len(sampled))
        part(0.0, f"finding rays, width {width}")
        views = _views(on, traced[0], samples, number, effort)
        runs = effort.runs if len(sampled) == 1 else 1
        _trace_pass(traced, views, tallies, runs, effort.threads, part.part(0.1, 1.0))
    pixels = effort.resolution[0] * effort.resolution[1]
    return [
        {
            "width": width,
            "wide_bytes": structure.statistics()["bytes"],
            "widen_seconds": widening,
            **trace_figures(own, pixels),
        }
        for structure, widening, own in zip(traced, widen_seconds, tallies, strict=True)
    ]


def _views(
    on: Scene, structure: TriangleQueries, samples: int, number: int, effort: Effort
) -> list[View]:
    """The rays of a pass, found with any structure."""
    return [
        path_view(
            structure,
            on.mesh,
            camera,
            samples=samples,
            share=effort.share,
            seed=(index + 1, number) if number else index + 1,
            size=effort.resolution,
            threads=effort.threads,
        )
        for index, camera in enumerate(on.cameras)
    ]


def _trace_pass(
    structures: Sequence[TriangleQueries],
    views: Sequence[View],
    tallies: Sequence[Sequence[Tally]],
    runs: int,
    threads: int,
    report: Span,
) -> None:
    clock = clock_of(threads)

    def work(structure: TriangleQueries, view: View) -> tuple[None, float]:
        began = clock()
        trace(structure, view, threads)
        return None, clock() - began

    every = [
        (structure, view, tally, f"tracing view {number + 1}")
        for structure, own in zip(structures, tallies, strict=True)
        for number, (view, tally) in enumerate(zip(views, own, strict=True))
    ]
    entries = [Timed(name, partial(work, structure, view)) for structure, view, _, name in every]
    timings = take_turns(entries, runs, report)
    for (_, view, tally, _), timing in zip(every, timings, strict=True):
        tally.add(timing.seconds, view)


def trace_figures(tallies: Sequence[Tally], pixels: int) -> Row:
    """Rays a second, and the seconds and rays of one sample of every pixel of a picture, means
    over the views."""
    rays = sum(tally.rays for tally in tallies)
    return {
        "rays": rays,
        "mrays_per_second": rays / sum(tally.seconds for tally in tallies) * 1e-6,
        **{
            f"view{number + 1}_mrays_per_second": tally.rays / tally.seconds * 1e-6
            for number, tally in enumerate(tallies)
        },
        "sample_seconds": fmean(tally.seconds / tally.paths * pixels for tally in tallies),
        "sample_rays": fmean(tally.rays / tally.paths * pixels for tally in tallies),
    }
