"""How good levels of detail are that were built in units, beside those built in memory.

    .venv/bin/python bench/scale_quality.py [--unit-triangles 65536] [--samples 50000] MESH...

For each share of the mesh's triangles: how many more triangles the build in units needs for the
same measured distance (root of the mean square, from points on the mesh to the cut and back), and
how much larger its distance is with the same number of triangles. Between cuts both are
interpolated in logarithms. The third pair of columns is chance: the build in memory of the same
mesh with its axes exchanged.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import umbel
from umbel.accel.bvh import Bvh
from umbel.scale.build_asset import build_asset

SHARES = (4, 16, 64, 256)


def points_on(mesh: umbel.Mesh, count: int) -> NDArray[np.float32]:
    """Even by area."""
    dice = np.random.default_rng(7)
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    at = (np.arange(count) + dice.uniform(size=count)) / count * areas.sum()
    triangle = np.minimum(np.searchsorted(np.cumsum(areas), at), len(areas) - 1)
    u, v = np.sqrt(dice.uniform(size=count)), dice.uniform(size=count)
    weights = np.stack([1 - u, u * (1 - v), u * v], axis=1)[:, :, None]
    return (corners[triangle] * weights).sum(axis=1).astype(np.float32)


class Curve:
    """The distance of a build's cuts by their triangles."""

    def __init__(self, asset: umbel.Asset, source: umbel.Mesh, samples: int) -> None:
        bvh, points = Bvh(source.positions, source.triangles), points_on(source, samples)
        sizes, distances = [], []
        for step in np.arange(1, 9.6, 0.5):
            budget = int(len(source.triangles) / 2**step)
            if budget < 200:
                break
            cut = asset.mesh(asset.cut(triangles=budget))
            shown = Bvh(cut.positions, cut.triangles)
            there = shown.closest_point(points).distance
            back = bvh.closest_point(points_on(cut, samples)).distance
            sizes.append(len(cut.triangles))
            distances.append(float(np.sqrt((there**2).mean() + (back**2).mean())))
        self.sizes, self.distances = np.log(sizes), np.log(distances)

    def distance(self, triangles: float) -> float:
        """With so many triangles."""
        return float(np.exp(np.interp(np.log(triangles), self.sizes[::-1], self.distances[::-1])))

    def triangles(self, distance: float) -> float:
        """For such a distance."""
        order = np.argsort(self.distances)
        return float(np.exp(np.interp(np.log(distance), self.distances[order], self.sizes[order])))


def main() -> None:
    """Builds and prints a line a mesh and share."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--unit-triangles", type=int, default=65536)
    parser.add_argument("--samples", type=int, default=50_000)
    args = parser.parse_args()
    print("| mesh | share | triangles | distance | chance: triangles | distance |")
    print("| --- | --: | --: | --: | --: | --: |")
    for path in args.meshes:
        source = umbel.load(path)
        source = umbel.Mesh(source.positions, source.triangles)
        turned = replace(source, positions=np.ascontiguousarray(source.positions[:, [1, 2, 0]]))
        with tempfile.TemporaryDirectory() as folder:
            core, units, other = (Path(folder) / f"{name}.umbel" for name in ("a", "b", "c"))
            umbel.build_lod(source).save(core)
            umbel.build_lod(turned).save(other)
            blocks = [(source.positions, source.triangles)]
            build_asset(blocks, units, unit_triangles=args.unit_triangles)
            base = Curve(umbel.Asset(core), source, args.samples)
            found = Curve(umbel.Asset(units), source, args.samples)
            chance = Curve(umbel.Asset(other), turned, args.samples)
        for share in SHARES:
            count = len(source.triangles) / share
            distance = base.distance(count)
            values = [
                ratio
                for one in (found, chance)
                for ratio in (one.triangles(distance) / count, one.distance(count) / distance)
            ]
            line = [path.stem, f"1/{share}", *(f"{value:.3f}" for value in values)]
            print(f"| {' | '.join(line)} |", flush=True)


if __name__ == "__main__":
    main()
