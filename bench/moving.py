"""Moving meshes: when does it pay to refit a BVH, to rebuild it, or to rebuild a kd-tree?

    python bench/moving.py [--frames N] [--size PIXELS] [--docs] [-o DIR] MESH...

One thread, processor time. Each mesh moves in two ways: it twists by three turns, as a whole; and
it bursts, its parts flying through each other to places at random. In each frame every
structure is brought up to date and then traced, primary rays of three views and one diffuse ray
from each of their hits; all must give the same hits. The time of a frame with any number of rays
follows. Writes moving.csv and moving.png into DIR; --docs also puts the table and the chart into
docs/moving.md.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np
from docs_tables import ROOT, fill, save_chart, table
from numpy.typing import NDArray

import umbel
from umbel.bench.bvh.rays import diffuse_rays, primary_rays

Positions = NDArray[np.float32]
Motion = Callable[[Positions, float], Positions]


def twist(rest: Positions, t: float) -> Positions:
    """Three turns over the length, at the end."""
    low, high = rest.min(0), rest.max(0)
    along = int(np.argmax(high - low))
    a, b = (k for k in range(3) if k != along)
    centred = rest - (low + high) / 2
    angle = 6 * np.pi * t * centred[:, along] / (high - low)[along]
    moved: Positions = rest.copy()
    moved[:, a] = np.cos(angle) * centred[:, a] - np.sin(angle) * centred[:, b]
    moved[:, b] = np.sin(angle) * centred[:, a] + np.cos(angle) * centred[:, b]
    return moved


def burst(rest: Positions, t: float) -> Positions:
    """Every three positions are a triangle; those of a cell of a coarse grid fly together."""
    low, high = rest.min(0), rest.max(0)
    centers = rest.reshape(-1, 3, 3).mean(1)
    cells = np.clip((centers - low) / (high - low).max() * 12, 0, 11).astype(np.int64)
    numbers = cells @ np.array([144, 12, 1])
    targets = np.random.default_rng(1).uniform(-0.5, 0.5, (1728, 3)) * (high - low)
    moved: Positions = (rest + np.repeat(targets[numbers] * t, 3, axis=0)).astype(np.float32)
    return moved


MOTIONS: dict[str, Motion] = {"twist": twist, "burst": burst}


class Refitted:
    """A BVH over the first frame; with `rebuilds`, it is built again when the refit advises it."""

    def __init__(self, rest: umbel.Mesh, rebuilds: bool) -> None:
        self.rebuilds = rebuilds
        self.bvh = umbel.Bvh(rest, threads=1)

    def __call__(self, mesh: umbel.Mesh) -> umbel.Bvh:
        if self.bvh.refit(mesh.positions, threads=1).rebuild_advised and self.rebuilds:
            self.bvh = umbel.Bvh(mesh, threads=1)
        return self.bvh


def strategies(rest: umbel.Mesh) -> dict[str, Callable[[umbel.Mesh], Any]]:
    """What brings a structure up to date, by name."""
    return {
        "BVH, refitted": Refitted(rest, rebuilds=False),
        "BVH, refitted, rebuilt when advised": Refitted(rest, rebuilds=True),
        "BVH, `lbvh`, rebuilt": partial(umbel.Bvh, builder="lbvh", threads=1),
        "BVH, rebuilt": partial(umbel.Bvh, threads=1),
        "kd-tree, binned, rebuilt": partial(umbel.KdTree, builder="binned", threads=1),
        "kd-tree, rebuilt": partial(umbel.KdTree, threads=1),
    }


def seconds_of(work: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and its processor time."""
    start = time.thread_time()
    result = work()
    return result, max(time.thread_time() - start, 1e-6)


def measure(path: Path, motion: str, frames: int, size: int) -> list[dict[str, Any]]:
    """A row for each frame and strategy."""
    mesh = umbel.load(path)
    rest, triangles = mesh.positions, mesh.triangles
    if motion == "burst":
        rest = rest[triangles.ravel()]
        triangles = np.arange(len(rest), dtype=np.uint32).reshape(-1, 3)
    update = strategies(umbel.Mesh(rest, triangles))
    rows = []
    for frame in range(1, frames + 1):
        now = umbel.Mesh(MOTIONS[motion](rest, frame / frames), triangles)
        rays = primary_rays(now.positions.min(0), now.positions.max(0), size)
        truth = umbel.Bvh(now).intersect(*rays)
        bounces = diffuse_rays(now, rays, truth.t, truth.primitive)
        for name, work in update.items():
            structure, updating = seconds_of(partial(work, now))
            hits, primary = seconds_of(partial(structure.intersect, *rays, threads=1))
            _, bounce = seconds_of(partial(structure.intersect, *bounces, threads=1))
            if not np.array_equal(hits.t, truth.t):
                raise SystemExit(f"{path.stem}: {name} gives other hits")
            rows.append(
                {
                    "mesh": path.stem,
                    "triangles": len(triangles),
                    "motion": motion,
                    "frame": frame,
                    "strategy": name,
                    "update_ms": 1e3 * updating,
                    "mrays": 1e-6 * (len(rays[0]) + len(bounces[0])) / (primary + bounce),
                }
            )
    return rows


def frame_times(rows: list[dict[str, Any]], motion: str) -> dict[str, tuple[float, float]]:
    """Of each strategy, nanoseconds a triangle of an update and microseconds a ray, on average."""
    found = {}
    for name in dict.fromkeys(row["strategy"] for row in rows):
        own = [row for row in rows if row["strategy"] == name and row["motion"] == motion]
        update = mean(1e6 * float(row["update_ms"]) / float(row["triangles"]) for row in own)
        found[name] = (update, mean(1 / float(row["mrays"]) for row in own))
    return found


def winners(times: dict[str, tuple[float, float]]) -> str:
    """Which strategy is done first, from how many rays a triangle on."""
    ways: list[str] = []
    at = 0.0
    name = min(times, key=lambda n: times[n])
    while True:
        ways.append(f"{name}" if not ways else f"from {at:.2g} {name}")
        update, ray = times[name]
        # Microseconds a ray against nanoseconds an update: both to nanoseconds.
        overtaking = {
            other: (slower - update) / (1e3 * (ray - faster))
            for other, (slower, faster) in times.items()
            if faster < ray and slower > update
        }
        if not overtaking:
            return "; ".join(ways)
        name = min(overtaking, key=lambda n: overtaking[n])
        at = overtaking[name]


def tables(rows: list[dict[str, Any]]) -> str:
    """Updates and speed by motion, and what is done first."""
    by_motion = {motion: frame_times(rows, motion) for motion in MOTIONS}
    head = ["", *(f"{m}: {what}" for m in MOTIONS for what in ("update, ns/triangle", "M rays/s"))]
    body = []
    for name in by_motion["twist"]:
        row = [name]
        for times in by_motion.values():
            update, ray = times[name]
            row += [f"{update:.0f}", f"{1 / ray:.2f}"]
        body.append(row)
    lines = [table(head, body), "", "Done first, by rays per triangle and frame:", ""]
    lines += [f"- {motion}: {winners(times)}." for motion, times in by_motion.items()]
    return "\n".join(lines)


def draw(rows: list[dict[str, Any]], file: Path) -> None:
    """The time of a frame against its rays, relative to the fastest."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.2), layout="constrained")
    rays = np.geomspace(0.003, 300, 200)
    for axes, motion in zip(figure.subplots(1, 2, sharey=True), MOTIONS, strict=True):
        times = frame_times(rows, motion)
        frames = {name: update + 1e3 * ray * rays for name, (update, ray) in times.items()}
        best = np.min(list(frames.values()), axis=0)
        for name, own in frames.items():
            axes.loglog(rays, own / best, label=name.replace("`", ""))
        axes.set(title=motion, xlabel="rays per triangle and frame", ylim=(0.95, 30))
        axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.axes[0].set_ylabel("time of a frame over the fastest")
    save_chart(figure, file)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("-o", dest="folder", type=Path, default=Path("."))
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    measured = args.folder / "moving.csv"
    if args.meshes:
        rows = [
            row
            for path in args.meshes
            for motion in MOTIONS
            for row in measure(path, motion, args.frames, args.size)
        ]
        with measured.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    with measured.open(newline="") as file:
        rows = list(csv.DictReader(file))
    text = tables(rows)
    print(text)
    chart = ROOT / "docs" / "images" / "moving.png" if args.docs else args.folder / "moving.png"
    draw(rows, chart)
    if args.docs:
        fill(ROOT / "docs" / "moving.md", {"moving": text})


if __name__ == "__main__":
    main()
