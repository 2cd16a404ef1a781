"""The table of docs/lod.md: what the costs and the least size of groups do.

    python bench/group_costs.py MESH... [--runs N]

Builds each mesh with one setting changed at a time. Fill: clusters of a group of level 0 over the
most that it may have. Overlap: the area that is common to the boxes of two groups of a level, over
all pairs, as a part of the area of all boxes. Triangles: of the cuts whose error is a thousandth
and a ten-thousandth of the mesh's diagonal. Time is that of the processor, the least of the runs.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import umbel

_MOST = 32  # clusters in a group

SETTINGS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("defaults (0.5, 0, 24)", {}),
    ("group_underfill_cost 0", {"group_underfill_cost": 0.0}),
    ("group_underfill_cost 1", {"group_underfill_cost": 1.0}),
    ("group_overlap_cost 0.5", {"group_overlap_cost": 0.5}),
    ("group_overlap_cost 1", {"group_overlap_cost": 1.0}),
    ("min_group 8", {"group_size": (8, 32)}),
    ("min_group 32", {"group_size": (32, 32)}),
)


def half_areas(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of boxes; 0 where a box is empty."""
    x, y, z = np.moveaxis(np.maximum(high - low, 0), -1, 0)
    inside = (high >= low).all(-1)
    return np.where(inside, x * y + y * z + z * x, 0.0)


def group_boxes(lod: umbel.Lod, level: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The corners of the boxes of a level's groups."""
    groups = lod.groups[lod.groups["level"] == level]
    begin, count = groups["cluster_offset"], groups["cluster_count"]
    parts = [slice(b, b + c) for b, c in zip(begin.tolist(), count.tolist(), strict=True)]
    clusters = lod.clusters
    low = np.array([clusters["box_min"][part].min(0) for part in parts], np.float64)
    high = np.array([clusters["box_max"][part].max(0) for part in parts], np.float64)
    return low, high


def overlap(lod: umbel.Lod) -> float:
    """The area of the intersections of all pairs of a level's boxes over the area of the boxes."""
    common = total = 0.0
    for level in range(int(lod.groups["level"].max()) + 1):
        low, high = group_boxes(lod, level)
        total += float(half_areas(low, high).sum())
        for i in range(len(low) - 1):
            rest = slice(i + 1, None)
            a, b = np.maximum(low[i], low[rest]), np.minimum(high[i], high[rest])
            common += float(half_areas(a, b).sum())
    return common / total


def fill(lod: umbel.Lod) -> float:
    """Of level 0's groups, in the mean."""
    counts = lod.groups["cluster_count"][lod.groups["level"] == 0]
    return float(counts.mean()) / _MOST


def triangles_at(lod: umbel.Lod, error: float) -> int:
    """Of the cut whose error is at most so large."""
    return int(lod.clusters["triangle_count"][lod.cut(error=error)].sum())


def cells(mesh: umbel.Mesh, given: dict[str, Any], runs: int) -> list[str]:
    """What is measured of a mesh with these settings."""
    taken = []
    for _ in range(runs):
        start = time.process_time()
        lod = umbel.build_lod(mesh, **given)
        taken.append(time.process_time() - start)
    diagonal = float(np.linalg.norm(np.ptp(mesh.positions, axis=0)))
    coarse, fine = (triangles_at(lod, part * diagonal) for part in (1e-3, 1e-4))
    return [
        f"{fill(lod):.1%}".replace("%", " %"),
        f"{overlap(lod):.2f}",
        f"{coarse:,}",
        f"{fine:,}",
        f"{min(taken):.2f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()
    columns = ("fill", "overlap", "triangles at 1e-3", "at 1e-4", "build s")
    heads = [f"{p.stem}: {columns[0]}" for p in args.meshes]
    header = [cell for head in heads for cell in (head, *columns[1:])]
    print(f"| | {' | '.join(header)} |")
    print(f"|---|{'--:|' * len(header)}")
    meshes = [umbel.load(path) for path in args.meshes]
    for name, given in SETTINGS:
        row = [cell for mesh in meshes for cell in cells(mesh, given, args.runs)]
        print(f"| {name} | {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
