"""Structures over triangles side by side: what a build costs, how fast rays pass, what it all
weighs, and from how many rays on which of them is done first.

    python bench/structures.py [--runs N] [--share F] [--growth] [--docs] [-o DIR] MESH...

One thread, processor time, medians of runs that take turns: primary rays of the three views of
`umbel bench bvh`, through a share of the pixels, and one diffuse ray from each hit. Every structure
must give the same hits. --growth also builds kd-trees over terrains of 0.1 to 4
million triangles. Writes structures.csv and growth.csv with their charts into DIR; --docs also
puts the tables and charts into docs/choosing.md and bench/results/structures-cpu.md, from DIR alone
if no mesh is named.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from docs_tables import ROOT, fill, save_chart, table

import umbel
from umbel.bench.bvh.paths import camera_rays
from umbel.bench.bvh.rays import Rays, diffuse_rays
from umbel.bench.bvh.scenes import scene

COSTS = (3.0, 2.0)
STRUCTURES: dict[str, Callable[..., Any]] = {
    "BVH, width 8": umbel.Bvh,
    "BVH, width 8, `best`": partial(umbel.Bvh, builder="best"),
    "BVH, width 8, `lbvh`": partial(umbel.Bvh, builder="lbvh"),
    "BVH, width 8, compact": partial(umbel.Bvh, compact=True),
    "BVH, width 2": partial(umbel.Bvh, width=2),
    "kd-tree, stack": umbel.KdTree,
    "kd-tree, ropes": partial(umbel.KdTree, ropes=True),
    "kd-tree, short stack": partial(umbel.KdTree, traversal="short-stack"),
    "kd-tree, binned": partial(umbel.KdTree, builder="binned"),
    "kd-tree, compact": partial(umbel.KdTree, compact=True),
    "two-level grid": umbel.TwoLevelGrid,
    "octree": umbel.Octree,
    "bounding intervals": umbel.IntervalHierarchy,
}
BASE = "BVH, width 2"
DEFAULT = "BVH, width 8"
TERRAINS = (0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 4.0)  # million triangles


def seconds_of(work: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and its processor time."""
    start = time.thread_time()
    result = work()
    return result, max(time.thread_time() - start, 1e-6)


def rays_of(on: Any, share: float) -> dict[str, Rays]:
    """Primary rays, and a bounce from each of their hits."""
    dice = np.random.default_rng(1)
    views = [camera_rays(camera, 1, share, dice) for camera in on.cameras]
    primary = tuple(np.concatenate(part) for part in zip(*views, strict=True))
    hits = umbel.Bvh(on.mesh).intersect(*primary)
    return {
        "primary": primary,
        "bounce": diffuse_rays(on.mesh, primary, hits.t, hits.primitive),
    }


def in_turns(
    on: Any, makers: Mapping[str, Callable[[], Any]], rays: dict[str, Rays], runs: int
) -> tuple[dict[str, Any], dict[str, dict[str, float]]]:
    """Structures by their names, and of each the median seconds of "build" and of each kind of
    rays, in runs that take turns. All must give the same hits."""
    truth = {kind: umbel.Bvh(on.mesh).intersect(*some).t for kind, some in rays.items()}
    times: dict[str, dict[str, list[float]]] = {
        name: {"build": [], **{kind: [] for kind in rays}} for name in makers
    }
    built = {}
    for _ in range(runs):
        for name, make in makers.items():
            built[name], seconds = seconds_of(make)
            times[name]["build"].append(seconds)
    for run in range(runs):
        for name, structure in built.items():
            for kind, some in rays.items():
                hits, seconds = seconds_of(partial(structure.intersect, *some, threads=1))
                times[name][kind].append(seconds)
                if run == 0 and not np.array_equal(hits.t, truth[kind]):
                    raise SystemExit(f"{on.name}: {name} gives other {kind} hits")
    medians = {name: {k: median(v) for k, v in own.items()} for name, own in times.items()}
    return built, medians


def measure(path: Path, runs: int, share: float) -> list[dict[str, Any]]:
    """A row for each structure."""
    on = scene(path.stem, lambda: umbel.load(path))
    rays = rays_of(on, share)
    makers = {
        name: partial(make, on.mesh, cost=COSTS, threads=1) for name, make in STRUCTURES.items()
    }
    built, times = in_turns(on, makers, rays, runs)
    rows = []
    triangles = len(on.mesh.triangles)
    for name, own in times.items():
        statistics = built[name].statistics()
        rows.append(
            {
                "mesh": path.stem,
                "triangles": triangles,
                "structure": name,
                "build_seconds": own["build"],
                "primary_mrays": len(rays["primary"][0]) / own["primary"] * 1e-6,
                "bounce_mrays": len(rays["bounce"][0]) / own["bounce"] * 1e-6,
                "bytes_a_triangle": statistics["bytes"] / triangles,
                "references_a_triangle": statistics["references"] / triangles,
                "sah_cost": statistics["sah_cost"],
            }
        )
        print(*rows[-1].values(), sep="\t", flush=True)
    return rows


def growth(runs: int) -> list[dict[str, Any]]:
    """Seconds of kd-trees over terrains."""
    rows = []
    for millions in TERRAINS:
        side = round(math.sqrt(millions * 1e6 / 2))
        mesh = umbel.shapes.terrain(side, side)
        for builder in ("exact", "binned"):
            own = [
                seconds_of(lambda b=builder, m=mesh: umbel.KdTree(m, builder=b, threads=1))[1]
                for _ in range(runs)
            ]
            triangles = len(mesh.triangles)
            rows.append({"triangles": triangles, "builder": builder, "seconds": median(own)})
            print(*rows[-1].values(), sep="\t", flush=True)
    return rows


def draw_growth(rows: list[dict[str, Any]], file: Path) -> None:
    """Seconds against triangles, beside N log N through the middle of them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.2), layout="constrained")
    axes = figure.subplots()
    for builder, color in (("exact", "#c0392b"), ("binned", "#2d6fb7")):
        own = [row for row in rows if row["builder"] == builder]
        n = np.array([float(row["triangles"]) for row in own])
        seconds = np.array([float(row["seconds"]) for row in own])
        factor = np.exp(np.mean(np.log(seconds / (n * np.log2(n)))))
        axes.loglog(n, seconds, "o", color=color, label=f"{builder}")
        axes.loglog(
            n,
            factor * n * np.log2(n),
            color=color,
            linewidth=1,
            label=f"{factor * 1e9:.0f} ns x N log2 N",
        )
    axes.set(xlabel="triangles", ylabel="seconds, one thread", title="Kd-trees over terrains")
    axes.grid(which="both", alpha=0.25)
    axes.legend(frameon=False)
    save_chart(figure, file)


LINES = {
    "BVH, width 8": "#2d6fb7",
    "BVH, width 8, `best`": "#111111",
    "BVH, width 8, `lbvh`": "#9bbfe0",
    "BVH, width 2": "#3f9b57",
    "kd-tree, stack": "#c0392b",
    "kd-tree, binned": "#e6a197",
    "two-level grid": "#e08e1b",
    "octree": "#8a6d3b",
    "bounding intervals": "#7d5ba6",
}
LABELS_BELOW = ("BVH, width 8", "BVH, width 2", "kd-tree, ropes")
"""Points of the chart of memory whose names would lie on others."""


def draw_rays(rows: list[dict[str, Any]], file: Path) -> None:
    """Of each mesh: build and trace together against the number of rays, half of them primary,
    relative to the default hierarchy."""
    from matplotlib.figure import Figure

    meshes = list(dict.fromkeys(row["mesh"] for row in rows))
    columns = 3
    lines = math.ceil(len(meshes) / columns)
    figure = Figure(figsize=(4.2 * columns, 3.1 * lines + 0.6), layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    count = np.logspace(4, 9, 60)
    for place, axes in enumerate(grid.flat):
        if place >= len(meshes):
            axes.axis("off")
            continue
        own = {row["structure"]: row for row in rows if row["mesh"] == meshes[place]}

        def total(row: dict[str, Any]) -> Any:
            per_ray = 0.5e-6 / float(row["primary_mrays"]) + 0.5e-6 / float(row["bounce_mrays"])
            return float(row["build_seconds"]) + count * per_ray

        base = total(own[DEFAULT])
        for name, color in LINES.items():
            axes.loglog(count, total(own[name]) / base, color=color, label=name.replace("`", ""))
        axes.set_title(f"{meshes[place]} ({int(own[BASE]['triangles']):,})", fontsize=10)
        axes.set_ylim(0.3, 12)
        axes.grid(alpha=0.25)
    for axes in grid.flat[max(len(meshes) - columns, 0) : len(meshes)]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("rays, half of them primary")
    figure.supylabel("build + trace, relative to the BVH of width 8")
    figure.legend(
        *grid.flat[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        frameon=False,
    )
    save_chart(figure, file)


def draw_memory(rows: list[dict[str, Any]], file: Path) -> None:
    """Geometric means over the meshes: bytes a triangle against bounce rays a second."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    axes = figure.subplots()
    for name in STRUCTURES:
        own = [row for row in rows if row["structure"] == name]
        x, y = (mean_of(own, key) for key in ("bytes_a_triangle", "bounce_mrays"))
        axes.loglog(x, y, "o", color=LINES.get(name, "#888888"))
        offset = (6, -10) if name in LABELS_BELOW else (6, 4)
        axes.annotate(
            name.replace("`", ""), (x, y), textcoords="offset points", xytext=offset, fontsize=8
        )
    axes.set(xlabel="bytes a triangle", ylabel="million bounce rays a second")
    axes.set_xlim(left=25, right=700)
    axes.grid(which="both", alpha=0.25)
    save_chart(figure, file)


def mean_of(rows: list[dict[str, Any]], key: str) -> float:
    """The geometric mean."""
    return math.exp(sum(math.log(float(row[key])) for row in rows) / len(rows))


def means(rows: list[dict[str, Any]]) -> dict[str, str]:
    """The Markdown table of docs/choosing.md: geometric means relative to the default."""
    fields = ("build_seconds", "primary_mrays", "bounce_mrays", "bytes_a_triangle")
    own = {name: [row for row in rows if row["structure"] == name] for name in STRUCTURES}
    lines = [
        [name, *(f"{mean_of(own[name], key) / mean_of(own[DEFAULT], key):.2f}" for key in fields)]
        for name in STRUCTURES
    ]
    head = ["", "build time", "primary rays/s", "bounce rays/s", "bytes"]
    return {"means": table(head, lines)}


def tables(rows: list[dict[str, Any]], grown: list[dict[str, Any]]) -> dict[str, str]:
    """The Markdown tables of bench/results/structures-cpu.md."""
    found = {}
    meshes = list(dict.fromkeys(row["mesh"] for row in rows))
    fields = {
        "build": ("build_seconds", ".3f", "s"),
        "primary": ("primary_mrays", ".2f", "M/s"),
        "bounce": ("bounce_mrays", ".2f", "M/s"),
        "bytes": ("bytes_a_triangle", ".0f", "B"),
    }
    value = {(row["mesh"], row["structure"]): row for row in rows}
    for name, (key, form, _) in fields.items():
        lines = []
        for structure in STRUCTURES:
            own = [value[mesh, structure] for mesh in meshes]
            base = [value[mesh, BASE] for mesh in meshes]
            ratio = mean_of(own, key) / mean_of(base, key)
            lines.append(
                [structure, *(format(float(row[key]), form) for row in own), f"{ratio:.2f}"]
            )
        found[name] = table(["", *meshes, "mean / width 2"], lines)
    lines = []
    for structure in ("BVH, width 8", "BVH, width 8, `best`", "kd-tree, stack", "kd-tree, binned"):
        own = [value[mesh, structure] for mesh in meshes]
        base = [value[mesh, BASE] for mesh in meshes]
        ratio = mean_of(own, "sah_cost") / mean_of(base, "sah_cost")
        lines.append([structure, *(f"{float(r['sah_cost']):.1f}" for r in own), f"{ratio:.2f}"])
    found["sah"] = table(["", *meshes, "mean / width 8"], lines)
    lines = []
    for row in grown:
        n, seconds = int(row["triangles"]), float(row["seconds"])
        speed, constant = n / seconds * 1e-6, 1e9 * seconds / (n * math.log2(n))
        lines.append(
            [f"{n:,}", row["builder"], f"{seconds:.2f}", f"{speed:.2f}", f"{constant:.0f}"]
        )
    found["growth"] = table(
        ["triangles", "builder", "seconds", "M triangles/s", "ns per N log2 N"], lines
    )
    return found


def write(rows: list[dict[str, Any]], file: Path) -> None:
    """As CSV."""
    with file.open("w", newline="") as out:
        writer = csv.DictWriter(out, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def read(file: Path) -> list[dict[str, Any]]:
    """As it was written; nothing where there is no file."""
    return list(csv.DictReader(file.open())) if file.exists() else []


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--share", type=float, default=0.05)
    parser.add_argument("--growth", action="store_true")
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("-o", "--output", type=Path, default=Path("structures"))
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    if args.meshes:
        rows = [row for path in args.meshes for row in measure(path, args.runs, args.share)]
        write(rows, args.output / "structures.csv")
    if args.growth:
        write(growth(args.runs), args.output / "growth.csv")
    rows, grown = read(args.output / "structures.csv"), read(args.output / "growth.csv")
    folder = ROOT / "docs" / "images" if args.docs else args.output
    if rows:
        draw_rays(rows, folder / "choosing-rays.png")
        draw_memory(rows, folder / "choosing-memory.png")
    if grown:
        results = ROOT / "bench" / "results" if args.docs else args.output
        draw_growth(grown, results / "structures-cpu-growth.png")
    if args.docs and rows and grown:
        fill(ROOT / "docs" / "choosing.md", means(rows))
        fill(ROOT / "bench" / "results" / "structures-cpu.md", tables(rows, grown))


if __name__ == "__main__":
    main()
