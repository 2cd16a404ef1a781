"""Holds the errors of builds with `measured_error` against dense samples of their own.

Every few levels, points all over the mesh are looked up on the cut of that level, and points all
over the cut on the mesh. Prints the largest distance over the error that the cut claims, for each
mesh; exits with 1 where one is above `--most`.

    scripts/check_measured_errors.py [--samples N] [--most X] MESH...
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import umbel
from umbel.accel.bvh import Bvh
from umbel.geometry.repair import weld


def points_on(mesh: umbel.Mesh, count: int) -> NDArray[np.float32]:
    """Even by area, and the vertices, where most of what is narrow ends."""
    random = np.random.default_rng(7)
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    at = (np.arange(count) + random.uniform(size=count)) / count * areas.sum()
    triangle = np.minimum(np.searchsorted(np.cumsum(areas), at), len(areas) - 1)
    u, v = random.uniform(size=(2, count))
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    weights = np.stack([1 - u - v, u, v], axis=1)[:, :, None]
    spread = (corners[triangle] * weights).sum(axis=1)
    return np.concatenate([spread, corners.reshape(-1, 3)]).astype(np.float32)


def farthest(points: NDArray[np.float32], bvh: Bvh) -> float:
    """From any of the points to the surface."""
    return float(bvh.closest_point(points).distance.max())


def worst_ratio(mesh: umbel.Mesh, samples: int) -> tuple[float, int]:
    """Of a true distance and the error claimed, and the triangles of the cut that has it."""
    mesh = weld(replace(mesh, material_ids=None))
    lod = umbel.build_lod(mesh, measured_error=True)
    source, points = Bvh(mesh.positions, mesh.triangles), points_on(mesh, samples)
    errors = np.unique(lod.groups["error"])
    errors = errors[np.isfinite(errors) & (errors > 0)]
    worst = (0.0, 0)
    for error in errors[:: max(len(errors) // 8, 1)]:
        cut = lod.cut(error=float(error))
        shown = lod.mesh(cut)
        makers = lod.clusters["generating_group"][cut]
        claimed = lod.groups["error"][makers[makers < len(lod.groups)]].max()
        there = farthest(points, Bvh(shown.positions, shown.triangles))
        back = farthest(points_on(shown, samples), source)
        worst = max(worst, (max(there, back) / float(claimed), len(shown.triangles)))
    return worst


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("meshes", nargs="+", metavar="MESH")
    parser.add_argument("--samples", type=int, default=200_000)
    parser.add_argument("--most", type=float, default=1.0)
    arguments = parser.parse_args()
    failed = 0
    for path in arguments.meshes:
        try:
            ratio, triangles = worst_ratio(umbel.load(path), arguments.samples)
        except umbel.Error as error:
            print(f"{path}: {error}")
            continue
        failed += ratio > arguments.most
        print(f"{ratio:6.3f}  {path}, at {triangles} triangles", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
