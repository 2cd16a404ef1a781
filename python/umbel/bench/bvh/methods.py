"""What is compared: builders of trees, other structures, and how much is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from umbel.accel.kdtree import KdTree
from umbel.accel.queries import TriangleQueries
from umbel.accel.tree_options import builders
from umbel.accel.uniform import IntervalHierarchy, Octree, TwoLevelGrid
from umbel.bench.bvh import kmeans as bvh_kmeans
from umbel.bench.bvh.columns import BASELINE
from umbel.bench.bvh.paths import HEIGHT, TILE, WIDTH
from umbel.bench.bvh.scenes import Kmeans
from umbel.errors import Error
from umbel.geometry.mesh import Mesh

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
    "octree": Octree,
    "bih": IntervalHierarchy,
}
"""What is compared besides hierarchies: the same for all widths."""


def compared_structures(only: Sequence[str] = ()) -> dict[str, Callable[..., TriangleQueries]]:
    """All of them, or those of these names."""
    return {name: make for name, make in STRUCTURES.items() if not only or name in only}


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    runs: int = 3
    """Medians of so many."""
    samples: int = 1
    """Paths a pixel."""
    share: float = 0.05
    """Of each picture's tiles."""
    resolution: tuple[int, int] = (WIDTH, HEIGHT)
    """Of the pictures, in whole tiles."""
    widths: Sequence[int] = (2, 8)
    """Children a node of what is traced."""
    threads: int = 0
    parts: Sequence[str] = PARTS
    """What is compared: the builders, the stages of k-means, its iterations."""
    builders: Sequence[str] = ()
    """Those that are compared with the full sweep; none: all."""

    def __post_init__(self) -> None:
        if any(side < TILE or side % TILE for side in self.resolution):
            raise Error(
                f"the resolution must be multiples of {TILE}, not {self.resolution[0]} x "
                f"{self.resolution[1]}"
            )
        unknown = [part for part in self.parts if part not in PARTS]
        if unknown or not self.parts:
            said = ", ".join(unknown) or "nothing"
            raise Error(f"parts must be of {', '.join(PARTS)}, not {said}")
        methods(Kmeans(8, 5, 2), self.builders)

    def build_runs(self, mesh: Mesh) -> int:
        """How often each tree is built."""
        return 1 if len(mesh.triangles) > LARGE else self.runs
