"""Batches of rays from Python: umbel.Bvh beside embreex (`pip install embreex`), one thread each.

    python bench/ray_batches.py [--size PIXELS] [--runs N] MESH...

Primary rays of three views, and one diffuse ray from each of their hits. Both libraries are asked
for distances, triangles and barycentric coordinates. Medians of processor time, by turns.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from statistics import geometric_mean, median
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

import umbel
from umbel.bench.bvh.rays import Rays, diffuse_rays, primary_rays


def seconds(work: Callable[[], Any]) -> float:
    """The processor time of a call."""
    start = time.thread_time()
    work()
    return time.thread_time() - start


def compare(bvh: umbel.Bvh, scene: Any, rays: Rays, runs: int) -> tuple[float, float, float]:
    """Million rays a second of ours and of embreex, and the fraction of equal triangles."""
    ours, theirs = [], []
    for _ in range(runs):
        ours.append(seconds(lambda: bvh.intersect(*rays, threads=1)))
        theirs.append(seconds(lambda: scene.run(*rays, output=True)))
    same = bvh.intersect(*rays).primitive == scene.run(*rays, output=True)["primID"]
    millions = len(rays[0]) * 1e-6
    return millions / median(ours), millions / median(theirs), float(np.mean(same))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--runs", type=int, default=5)
    args = parser.parse_args()
    ratios: dict[str, list[float]] = {}
    print("| | rays | umbel M/s | embreex M/s | ratio | same triangle |")
    print("|---|---|--:|--:|--:|--:|")
    for path in args.meshes:
        mesh = umbel.load(path)
        bvh, scene = umbel.Bvh(mesh), EmbreeScene()
        TriangleMesh(scene, mesh.positions, mesh.triangles.astype(np.int32))
        primary = primary_rays(mesh.positions.min(0), mesh.positions.max(0), args.size)
        hits = bvh.intersect(*primary)
        diffuse = diffuse_rays(mesh, primary, hits.t, hits.primitive)
        for kind, rays in (("primary", primary), ("diffuse", diffuse)):
            ours, theirs, same = compare(bvh, scene, rays, args.runs)
            ratios.setdefault(kind, []).append(ours / theirs)
            print(
                f"| {path.name} | {kind} | {ours:.2f} | {theirs:.2f} | {ours / theirs:.3f} "
                f"| {same:.5f} |"
            )
    for kind, values in ratios.items():
        print(f"| geometric mean | {kind} | | | {geometric_mean(values):.3f} | |")


if __name__ == "__main__":
    main()
