"""k-means alone: its time by stage, and the SAH cost after each number of iterations."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from umbel.accel.trees import build_bvh2, kmeans_times
from umbel.bench.bvh.scenes import COSTS, PRESETS, Kmeans
from umbel.bench.table import Row, columns
from umbel.bench.timing import Span
from umbel.geometry.mesh import Mesh

SEEDED = ((8, 5), (16, 5), (32, 20), (64, 30))
"""k and p."""
COUNTS = (0, 1, 2, 3, 5, 7, 10)
"""Iterations."""

PUBLISHED: dict[str, Any] = {"forwarded_clusters": 1}
VARIANTS: Mapping[str, dict[str, Any]] = {"kmeans 2016": PUBLISHED, "kmeans": {}}
"""As published, and as it is here."""

STAGES = columns(
    """
    scene      | scene
    preset     | preset
    clusters   | k      | d
    candidates | p      | d
    iterations | i      | d
    stage      | stage
    seconds    | s      | .4f
    """
)
ITERATIONS = columns(
    """
    scene      | scene
    builder    | builder
    clusters   | k                     | d
    candidates | p                     | d
    iterations | i                     | d
    sah_cost   | SAH                   | .2f
    sweep      | SAH of the full sweep | .2f
    """
)


STAGE_NAMES = {
    "boxes": "bounding boxes computation",
    "seeding": "k-means initialization",
    "iterations": "k-means loop",
    "sizes": "cluster size computation",
    "reordering": "triangle indices reordering",
    "agglomeration": "agglomerative clustering",
    "other": "other computation",
}
"""As on the slides, but that boxes of nodes are part of agglomeration."""


def stage_rows(name: str, mesh: Mesh, runs: int, report: Span) -> list[Row]:
    """The seconds of each stage on one thread for each preset: those of the run that took the
    median time."""
    rows = []
    for number, (preset, kmeans) in enumerate(PRESETS.items()):
        measured = []
        for run in range(runs):
            report((number + run / runs) / len(PRESETS), f"k-means {preset}")
            wall, used = time.perf_counter(), time.thread_time()
            stages = kmeans_times(mesh, cost=COSTS, **kmeans.arguments())
            wall, used = time.perf_counter() - wall, time.thread_time() - used
            measured.append(processor_seconds(stages, wall, used))
        measured.sort(key=lambda seconds: sum(seconds.values()))
        for stage, seconds in measured[len(measured) // 2].items():
            rows.append(
                {
                    "scene": name,
                    "preset": preset,
                    **kmeans.arguments(),
                    "stage": STAGE_NAMES[stage],
                    "seconds": seconds,
                }
            )
    return rows


def processor_seconds(stages: Mapping[str, float], wall: float, used: float) -> dict[str, float]:
    """Stages by the wall clock, and what is missing to the whole, in processor time: other
    programs slow all stages down alike."""
    whole = {**stages, "other": max(wall - sum(stages.values()), 0.0)}
    return {stage: seconds * used / wall for stage, seconds in whole.items()}


def iteration_rows(name: str, mesh: Mesh, threads: int, report: Span) -> list[Row]:
    """SAH costs after several numbers of iterations, for several k, and that of the full sweep."""
    sweep = build_bvh2(mesh, builder="sweep", cost=COSTS, threads=threads).sah_cost()
    rows = []
    tried = [
        (builder, settings, Kmeans(k, p, i))
        for builder, settings in VARIANTS.items()
        for k, p in SEEDED
        for i in COUNTS
    ]
    for number, (builder, settings, kmeans) in enumerate(tried):
        report(number / len(tried), f"{builder} with {kmeans}")
        tree = build_bvh2(
            mesh,
            builder="kmeans",
            cost=COSTS,
            threads=threads,
            **kmeans.arguments(),
            **settings,
        )
        rows.append(
            {
                "scene": name,
                "builder": builder,
                **kmeans.arguments(),
                "sah_cost": tree.sah_cost(),
                "sweep": sweep,
            }
        )
    return rows
