"""k-means alone: where its time goes, and what its iterations bring."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..bvh import Bvh2, build_bvh2
from ..mesh import Mesh
from ..repair import Progress
from .bvh_scenes import COSTS, PRESETS, Kmeans
from .table import Column, Row
from .timing import Span

SEEDED = ((8, 5), (16, 5), (32, 20), (64, 30))
"""k and p."""
COUNTS = (0, 1, 2, 3, 5, 7, 10)
"""Iterations."""

STAGES = [
    Column("scene", "scene"),
    Column("preset", "preset"),
    Column("clusters", "k", "d"),
    Column("candidates", "p", "d"),
    Column("iterations", "i", "d"),
    Column("stage", "stage"),
    Column("seconds", "s", ".4f"),
]
ITERATIONS = [
    Column("scene", "scene"),
    Column("clusters", "k", "d"),
    Column("candidates", "p", "d"),
    Column("iterations", "i", "d"),
    Column("sah_cost", "SAH", ".2f"),
    Column("sweep", "SAH of the full sweep", ".2f"),
]


class StageClock:
    """Sums the seconds between reports of progress by stage. A callback for builds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.seconds: dict[str, float] = {}
        self._clock = clock
        self._stage: str | None = None
        self._since = 0.0

    def __call__(self, _fraction: float, stage: str) -> None:
        now = self._clock()
        self._close(now)
        self._stage, self._since = stage, now

    def stop(self) -> dict[str, float]:
        """Ends the last stage; the seconds of each."""
        self._close(self._clock())
        self._stage = None
        return self.seconds

    def _close(self, now: float) -> None:
        if self._stage is not None:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since


def stage_rows(name: str, mesh: Mesh, runs: int, threads: int, report: Span) -> list[Row]:
    """The seconds of each stage for each preset: those of the run that took the median time."""
    clock = time.process_time if threads == 1 else time.perf_counter
    rows = []
    for number, (preset, kmeans) in enumerate(PRESETS.items()):
        measured = []
        for run in range(runs):
            report((number + run / runs) / len(PRESETS), f"k-means {preset}")
            stages = StageClock(clock)
            _build(mesh, kmeans, threads, stages)
            measured.append(stages.stop())
        measured.sort(key=lambda seconds: sum(seconds.values()))
        for stage, seconds in measured[len(measured) // 2].items():
            rows.append(
                {
                    "scene": name,
                    "preset": preset,
                    **kmeans.arguments(),
                    "stage": stage,
                    "seconds": seconds,
                }
            )
    return rows


def iteration_rows(name: str, mesh: Mesh, threads: int, report: Span) -> list[Row]:
    """SAH costs after several numbers of iterations, for several k, and that of the full sweep."""
    sweep = build_bvh2(mesh, builder="sweep", cost=COSTS, threads=threads).sah_cost()
    rows = []
    tried = [Kmeans(k, p, i) for k, p in SEEDED for i in COUNTS]
    for number, kmeans in enumerate(tried):
        report(number / len(tried), f"k-means with {kmeans}")
        cost = _build(mesh, kmeans, threads).sah_cost()
        rows.append({"scene": name, **kmeans.arguments(), "sah_cost": cost, "sweep": sweep})
    return rows


def _build(mesh: Mesh, kmeans: Kmeans, threads: int, progress: Progress | None = None) -> Bvh2:
    arguments = kmeans.arguments()
    return build_bvh2(
        mesh, builder="kmeans", cost=COSTS, **arguments, progress=progress, threads=threads
    )
