"""Clusters of a mesh that twists, bends and shakes: charts and pictures of their quality and cost.

    python examples/python/5_deforming.py [MESH [FOLDER]] [--frames 300]

Compares clusters that are kept (with boxes over all frames), refitted, rebuilt in every frame, and
rebuilt when a policy says so. Needs matplotlib.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import matplotlib
import numpy as np

import umbel

matplotlib.use("Agg")
import matplotlib.pyplot as plt

WIDTH, HEIGHT = 800, 600


def unit_scaled(positions: np.ndarray) -> tuple[np.ndarray, float]:
    """Positions centred at the origin, and the scene's size."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    return (positions - (low + high) / 2).astype(np.float32), float((high - low).max())


def deformed(rest: np.ndarray, size: float, t: float) -> np.ndarray:
    """The positions at t in [0, 1]: at rest at both ends, fully deformed in the middle."""
    amount = np.sin(np.pi * t) ** 2
    x, y, z = (rest / size).T
    # Twist around x, by up to a turn and a half over the length.
    angle = 3 * np.pi * amount * x
    c, s = np.cos(angle), np.sin(angle)
    y, z = y * c - z * s, y * s + z * c
    # Bend in the plane of x and y.
    if amount > 1e-3:
        bend = 1.8 * amount
        x, y = np.sin(bend * x) * (1 / bend - y), 1 / bend - np.cos(bend * x) * (1 / bend - y)
    # Noise: three travelling waves.
    phase = 2 * np.pi * (5 * t)
    for k, (a, b) in enumerate([(23, 31), (41, 17), (29, 53)]):
        wave = 0.012 * amount * np.sin(a * x + b * z + phase * (k + 1))
        x, y, z = (x + wave, y, z) if k == 0 else (x, y + wave, z) if k == 1 else (x, y, z + wave)
    return (np.stack([x, y, z], axis=1) * size).astype(np.float32)


def area(boxes: np.ndarray) -> np.ndarray:
    """Half the surface areas of boxes (k, 6)."""
    d = np.maximum(boxes[:, 3:] - boxes[:, :3], 0).astype(np.float64)
    return d[:, 0] * d[:, 1] + d[:, 1] * d[:, 2] + d[:, 2] * d[:, 0]


def overlap(boxes: np.ndarray) -> float:
    """Mean number of boxes that a random line through the box of all intersects."""
    whole = np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])[None]
    return float(area(boxes).sum() / area(whole)[0])


def timed(work, positions: np.ndarray) -> float:
    """Processor milliseconds of a frame's work."""
    start = time.thread_time()
    work(positions)
    return 1e3 * (time.thread_time() - start)


def run(mesh, frames: int, policy: umbel.RebuildPolicy, part: umbel.RebuildPolicy):
    rest, size = unit_scaled(mesh.positions)
    still = umbel.Mesh(positions=rest, triangles=mesh.triangles)

    def make(method: str = "hybrid") -> umbel.FrameClusters:
        return umbel.FrameClusters(still, method, threads=1)

    refitted, rebuilt, morton = make(), make(), make("morton")
    by_policy, by_parts = make(), make()
    held = refitted.boxes
    names = ["refitted", "rebuilt", "policy", "partial", "Morton, rebuilt"]
    rows = {name: [] for name in names}
    costs = {name: [] for name in names}
    since = {"policy": 0, "partial": 0}
    rebuilds = {"policy": [], "partial": []}
    for frame in range(frames):
        positions = deformed(rest, size, frame / (frames - 1))
        costs["refitted"].append(timed(refitted.refit, positions))
        boxes = refitted.boxes
        held = np.concatenate(
            [np.minimum(held[:, :3], boxes[:, :3]), np.maximum(held[:, 3:], boxes[:, 3:])], axis=1
        )
        costs["rebuilt"].append(timed(rebuilt.update, positions))
        costs["Morton, rebuilt"].append(timed(morton.update, positions))
        for name, clusters, rule in [("policy", by_policy, policy), ("partial", by_parts, part)]:
            since[name] += 1
            start = time.thread_time()
            action = clusters.step(positions, rule, since[name])
            costs[name].append(1e3 * (time.thread_time() - start))
            if action != "keep":
                since[name] = 0
                rebuilds[name].append(frame)
        for name, clusters in [
            ("refitted", refitted),
            ("rebuilt", rebuilt),
            ("Morton, rebuilt", morton),
            ("policy", by_policy),
            ("partial", by_parts),
        ]:
            rows[name].append(overlap(clusters.boxes))
    rows["kept"] = [overlap(held)] * frames
    costs["kept"] = [0.0] * frames
    return rows, costs, rebuilds


def chart(path: Path, rows, costs, rebuilds, frames: int) -> None:
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 7), sharex=True)
    names = ["kept", "refitted", "Morton, rebuilt", "rebuilt", "policy", "partial"]
    labels = {
        "kept": "kept: boxes over all frames",
        "refitted": "refitted",
        "rebuilt": "rebuilt each frame (hybrid)",
        "Morton, rebuilt": "rebuilt each frame (Morton)",
        "policy": f"policy: growth of 1.15, {len(rebuilds['policy'])} rebuilds",
        "partial": f"policy with a tenth of the clusters, {len(rebuilds['partial'])} times",
    }
    for name in names:
        top.plot(rows[name], label=labels[name], linewidth=1.4)
        bottom.plot(costs[name], label=labels[name], linewidth=1.0)
    top.set_ylabel("clusters that a random line intersects")
    top.set_yscale("log")
    top.legend(fontsize=8)
    bottom.set_ylabel("processor time, ms a frame")
    bottom.set_xlabel(f"frame of {frames}")
    bottom.set_ylim(bottom=0)
    for axes in (top, bottom):
        axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def picture(path: Path, positions: np.ndarray, clusters: umbel.FrameClusters, samples: int) -> None:
    """A picture with one colour per cluster."""
    sizes = np.diff(clusters.offsets)
    label = np.repeat(np.arange(len(sizes)), sizes)
    corners = clusters.triangles.reshape(-1)
    mesh = umbel.Mesh(
        positions=positions[corners],
        triangles=np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
        colors=np.repeat(umbel.cluster_colors(len(sizes))[label], 3, axis=0),
    )
    pixels = umbel.render(mesh, width=WIDTH, height=HEIGHT, samples=samples)
    umbel.save_picture(path, pixels)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("mesh", nargs="?", help="without it a small generated mesh, quickly")
    parser.add_argument("folder", nargs="?", default=".")
    parser.add_argument("--frames", type=int)
    parser.add_argument("--samples", type=int, help="a pixel of the pictures; 0: none")
    options = parser.parse_args()
    quick = options.mesh is None
    frames = options.frames or (12 if quick else 300)
    samples = (0 if quick else 16) if options.samples is None else options.samples
    folder = Path(options.folder)
    folder.mkdir(parents=True, exist_ok=True)
    mesh = umbel.shapes.blob(5) if quick else umbel.load(options.mesh)
    policy = umbel.RebuildPolicy(threshold=1.15)
    part = umbel.RebuildPolicy(threshold=1.15, budget=0.1)
    rows, costs, rebuilds = run(mesh, frames, policy, part)
    chart(folder / "deforming.png", rows, costs, rebuilds, frames)
    print(f"{'':18}{'overlap, mean':>14}{'worst':>8}{'ms a frame, mean':>18}{'median':>9}")
    for name, values in rows.items():
        print(
            f"{name:18}{np.mean(values):14.3f}{np.max(values):8.3f}"
            f"{np.mean(costs[name]):18.1f}{np.median(costs[name]):9.1f}"
        )
    for name, at in rebuilds.items():
        print(f"{name}: rebuilt in {len(at)} of {frames} frames")
    if samples > 0:
        rest, size = unit_scaled(mesh.positions)
        worst = deformed(rest, size, 0.5)
        still = umbel.Mesh(positions=rest, triangles=mesh.triangles)
        clusters = umbel.FrameClusters(still)
        picture(folder / "deforming-rest.png", rest, clusters, samples)
        picture(folder / "deforming-kept.png", worst, clusters, samples)
        clusters.build(worst)
        picture(folder / "deforming-rebuilt.png", worst, clusters, samples)


if __name__ == "__main__":
    main()
