"""The table of docs/streaming.md: pages that are loaded again, by the hysteresis of a residency.

    python bench/hysteresis.py MESH... [--budget SHARE] [--seconds S] [--values H,...]

Builds each mesh at 16 bits into pages of 16 KiB. A camera walks round it at 60 frames a second and
sways a few degrees to and fro four times a second, over a simulated disk. Cuts changed: frames
whose cut is another than that of the frame before.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path
from statistics import mean, median

import numpy as np

import umbel
from umbel.bench.stream import ASPECT, FRAMES_PER_SECOND, LINES

SWAY = 0.05  # radians to each side
SWAYS_PER_SECOND = 4


def cameras(asset: umbel.Asset, frames: int) -> list[umbel.Camera]:
    """Round the asset's box in a minute, swaying."""
    low, high = (np.array(corner, np.float64) for corner in asset.info["bounds"])
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    found = []
    for frame in range(frames):
        seconds = frame / FRAMES_PER_SECOND
        turn = 2 * math.pi * seconds / 60
        turn += SWAY * math.sin(2 * math.pi * SWAYS_PER_SECOND * seconds)
        eye = middle + 0.6 * size * np.array([math.cos(turn), 0.1, math.sin(turn)])
        found.append(umbel.Camera(eye.tolist(), target=middle.tolist()))
    return found


def walk(asset: umbel.Asset, share: float, hysteresis: float, frames: int) -> list[float]:
    """Loads, reloads, cuts changed, the median error in pixels, and milliseconds a step."""
    budget = int(share * asset.info["file_bytes"])
    residency = umbel.Residency(asset, budget, hysteresis=hysteresis, link=LINES["disk"])
    errors, times, changes = [], [], 0
    before = None
    for frame, camera in enumerate(cameras(asset, frames)):
        step = residency.step([camera], frame / FRAMES_PER_SECOND, ASPECT)
        errors.append(step["worst_error"])
        times.append(1e3 * step["seconds"])
        cut = residency.cut()
        changes += before is not None and not np.array_equal(before, cut)
        before = cut
    found = residency.statistics
    return [found["loads"], found["reloads"], changes, median(errors), mean(times)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--budget", type=float, default=0.25, help="share of the file")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--values", default="1,1.25,1.5,2,4")
    args = parser.parse_args()
    print("| | hysteresis | loads | reloads | cuts changed | median px | step ms |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    with tempfile.TemporaryDirectory() as folder:
        for mesh in args.meshes:
            path = Path(folder) / f"{mesh.stem}.umbel"
            lod = umbel.build_lod(umbel.load(mesh), precision="16bits")
            lod.save(path, page_bytes=16384)
            asset = umbel.Asset(path)
            frames = int(args.seconds * FRAMES_PER_SECOND)
            for value in map(float, args.values.split(",")):
                loads, reloads, changes, error, step = walk(asset, args.budget, value, frames)
                print(
                    f"| {mesh.stem} | {value:g} | {loads} | {reloads} | {changes} | {error:.2f} "
                    f"| {step:.3f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
