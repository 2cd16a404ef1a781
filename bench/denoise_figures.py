"""The table of docs/render.md: noise of path-traced pictures before and after denoising, in dB.

    python bench/denoise_figures.py [--data FOLDER] [--samples N] [--reference N] [--size WxH]

The peak signal-to-noise ratio of tone-mapped pictures to one of many paths with another seed. The
denoiser is told nothing, the albedo, or the albedo and the normals of what is seen. Its time is
that of the processor, over all threads.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

import umbel

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("UMBEL_DATA") or ROOT.parent / "shared" / "data")

#: Name, file, camera, and what else the renderer is given.
SCENES: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
    ("sibenik_75k", "sibenik_75k.ply", "auto", {}),
    ("car_lamborghini, on a floor", "car_lamborghini.glb", "auto:-12,9:26", {"ground": True}),
    (
        "cat, textured, on a floor",
        "textured/cat.glb",
        "2.05,0.9,4.51:0.08,0.45,-0.06:15",
        {"ground": True},
    ),
)


def decibels(picture: NDArray[np.float32], truth: NDArray[np.float32], exposure: float) -> float:
    """The peak signal-to-noise ratio of two pictures as they are shown."""
    ours, theirs = (umbel.tone_map(p, exposure).astype(float) for p in (picture, truth))
    return 10 * math.log10(255**2 / float(np.mean((ours - theirs) ** 2)))


def exposure_of(truth: NDArray[np.float32]) -> float:
    """Stops that map the mean brightness to middle grey, the same for all pictures of a scene."""
    return math.log2(0.18 / float(np.mean(truth)))


def seconds(work: Callable[[], Any], runs: int = 5) -> float:
    """The median of the processor time of a call, after one to warm up."""
    taken = []
    for _ in range(runs + 1):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return median(taken[1:])


def row(path: Path, camera: str, given: dict[str, Any], args: argparse.Namespace) -> list[float]:
    """Decibels of the noisy picture and of three denoised ones; seconds of tracing, of the
    features and of denoising."""
    renderer = umbel.Renderer(path, **given)
    width, height = map(int, args.size.split("x"))

    def film(seed: int) -> umbel.Film:
        return renderer.film(camera, width=width, height=height, seed=seed)

    truth = film(9).add(args.reference).pixels
    start = time.process_time()
    noisy = film(1).add(args.samples)
    traced = time.process_time()
    albedo, normal = noisy.features()
    seen = time.process_time()
    pixels = noisy.pixels
    pictures = (
        pixels,
        umbel.denoise(pixels),
        umbel.denoise(pixels, albedo),
        umbel.denoise(pixels, albedo, normal),
    )
    exposure = exposure_of(truth)
    taken = seconds(lambda: umbel.denoise(pixels, albedo, normal))
    found = [decibels(picture, truth, exposure) for picture in pictures]
    return [*found, traced - start, seen - traced, taken]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--reference", type=int, default=1024)
    parser.add_argument("--size", default="240x180")
    args = parser.parse_args()
    print(
        f"| {args.size}, {args.samples} paths | noisy | denoised | with albedo | and normals "
        "| tracing s | features s | denoising s |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    for name, file, camera, given in SCENES:
        found = row(args.data / file, camera, given, args)
        cells = [f"{v:.1f}" for v in found[:4]] + [f"{v:.2f}" for v in found[4:]]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
