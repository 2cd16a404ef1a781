"""What `umbel bvh` and `umbel kdtree` share: the names of flags, costs, and the speed of rays."""

from __future__ import annotations

import statistics
import time
from typing import TYPE_CHECKING, Annotated

import typer

from umbel.cli.run import fail

if TYPE_CHECKING:
    from umbel.accel.queries import TriangleQueries
    from umbel.bench.bvh.rays import Rays
    from umbel.geometry.mesh import Mesh

PICTURE = 512
"""Pixels a side of the three views whose primary rays are traced."""
RUNS = 3

Costs = Annotated[str, typer.Option(metavar="T,I", help="Costs of traversal and intersection.")]
Compact = Annotated[bool, typer.Option(help="Share vertices: smaller, slower rays.")]
DropInvalid = Annotated[
    bool, typer.Option(help="Leave out triangles with a NaN or infinite vertex.")
]

FLAGS = {
    "cost.traversal": "the first number of --cost",
    "cost.intersection": "the second number of --cost",
    "kmeans.clusters": "--clusters",
    "kmeans.candidates": "--candidates",
    "kmeans.iterations": "--iterations",
    "kmeans.forwarded_clusters": "--forwarded-clusters",
    "aac.leaf_size": "--aac-leaf-size",
    "aac.epsilon": "--aac-epsilon",
}


def parse_cost(text: str) -> tuple[float, float]:
    """(traversal, intersection) of a text such as 3,2."""
    try:
        traversal, intersection = (float(part) for part in text.split(","))
    except ValueError:
        fail(f"--cost is {text!r}, but must be two numbers such as 3,2")
    return traversal, intersection


def ray_speeds(structure: TriangleQueries, mesh: Mesh, threads: int) -> dict[str, float]:
    """Millions of rays a second: primary rays of three views, and a diffuse ray from each hit."""
    from umbel.bench.bvh.rays import diffuse_rays, primary_rays

    box = structure.bounds
    primary = diffuse = None
    if box is not None:
        primary = primary_rays(box[0], box[1], PICTURE)
        hits = structure.intersect(*primary, threads=threads)
        diffuse = diffuse_rays(mesh, primary, hits.t, hits.primitive)
    return {
        "primary_mrays_per_second": _speed(structure, primary, threads),
        "diffuse_mrays_per_second": _speed(structure, diffuse, threads),
    }


def _speed(structure: TriangleQueries, rays: Rays | None, threads: int) -> float:
    """The median of some runs, in millions of rays a second."""
    if rays is None or len(rays[0]) == 0:
        return 0.0
    seconds = []
    for _ in range(RUNS):
        began = time.perf_counter()
        structure.intersect(*rays, threads=threads)
        seconds.append(time.perf_counter() - began)
    return len(rays[0]) / max(statistics.median(seconds), 1e-9) / 1e6
