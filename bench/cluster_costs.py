"""What the costs of clusters beside area take and gain: overlap, connections, limits on vertices.

    python bench/cluster_costs.py [--runs N] [--parts PART...] [--docs] FOLDER

One thread, processor time, medians of runs that take turns, on meshes of FOLDER that are welded
first. The parts: `costs` compares builds with each cost; `large` says what a cost takes and gains
in nodes too large for a block; `weights` measures clusters that end at creases; `vertices` builds
with at most 64 vertices. --docs puts the tables into docs/clusters.md and needs all parts.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean, geometric_mean, median
from typing import Any

import numpy as np
from docs_tables import ROOT, fill, table

import umbel
from umbel.cluster.weights import face_normals, normal_connections

COSTS: dict[str, dict[str, float]] = {
    "none": {},
    "`overlap_cost` 0.1": {"overlap_cost": 0.1},
    "`overlap_cost` 1": {"overlap_cost": 1.0},
    "`shared_vertex_weight` 0.3": {"shared_vertex_weight": 0.3},
    "`shared_vertex_weight` 1": {"shared_vertex_weight": 1.0},
    "`normal_weight` 4": {"normal_weight": 4.0},
    "both weights": {"shared_vertex_weight": 0.3, "normal_weight": 4.0},
    "both weights, `overlap_cost` 0.1": {
        "shared_vertex_weight": 0.3,
        "normal_weight": 4.0,
        "overlap_cost": 0.1,
    },
}
COST_MESHES = ("sibenik_75k", "turbineblade_199k", "conference_331k", "dragon_871k")
#: Items of the largest blocks, without connections and with them.
BLOCK, CONNECTED_BLOCK = 1 << 12, 1 << 16
LARGE_COSTS = {
    "`overlap_cost` 0.1": BLOCK,
    "`shared_vertex_weight` 0.3": CONNECTED_BLOCK,
    "`normal_weight` 4": CONNECTED_BLOCK,
    "both weights": CONNECTED_BLOCK,
}
LARGE_MESHES = ("turbineblade_199k", "bench_arch_329k", "conference_331k", "dragon_871k")
TERRAIN = 2_000_000
WEIGHT_MESHES = ("turbineblade_199k", "bunny_69k", "sibenik_75k")
WEIGHTS = {
    "none": "none",
    "shared-vertices": "`shared_vertex_weight` 0.3",
    "normals": "`normal_weight` 4",
    "both": "both weights",
}
VERTEX_MESHES = (
    "igea_269k",
    "conference_331k",
    "sibenik_75k",
    "bunny_69k",
    "horse_97k",
    "turbineblade_199k",
    "bench_arch_329k",
)
VERTICES = 64
#: underfill_cost and vertex_underfill_cost.
UNDERFILL = ((0.0, 0.0), (0.3, 0.0), (0.0, 0.5), (0.3, 0.5), (1.0, 0.5), (0.3, 1.0))
LIMITS = tuple((preset, most) for preset in ("quality", "fast") for most in (0, 128, VERTICES))
PARTS = ("costs", "large", "weights", "vertices")
#: Triangles whose centres are looked for in all boxes.
CENTRES = 4096

Row = dict[str, Any]


def in_turns(works: Mapping[str, Callable[[], Any]], runs: int) -> dict[str, tuple[Any, float]]:
    """What each gives, and the median of its processor time."""
    results: dict[str, Any] = {}
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(runs):
        for name, work in works.items():
            start = time.process_time()
            results[name] = work()
            times[name].append(time.process_time() - start)
    return {name: (results[name], median(times[name])) for name in works}


def mesh_of(folder: Path, name: str) -> umbel.Mesh:
    if name == "terrain":
        side = round(math.sqrt(TERRAIN / 2))
        return umbel.shapes.terrain(side, side)
    return umbel.weld(umbel.load(folder / f"{name}.ply"), threads=1)


def boxes_at_centres(mesh: umbel.Mesh, boxes: np.ndarray) -> float:
    """In how many boxes the centre of a triangle lies, on average over some thousand of them."""
    chosen = np.random.default_rng(1).choice(len(mesh.triangles), CENTRES)
    centres = mesh.positions[mesh.triangles[chosen]].mean(axis=1)
    inside = [
        int(((boxes[:, :3] <= centre) & (centre <= boxes[:, 3:])).all(axis=1).sum())
        for centre in centres
    ]
    return fmean(inside)


def quality(mesh: umbel.Mesh, clusters: umbel.Clusters) -> Row:
    """Of the clusters of a mesh's triangles."""
    measured = clusters.metrics()
    return {
        "clusters": len(clusters),
        "vertices": measured["mean_vertices"] * len(clusters) / len(mesh.triangles),
        "vertex_fill": measured["mean_vertices"] / VERTICES,
        "boxes": boxes_at_centres(mesh, umbel.cluster_boxes(mesh, clusters)),
        "area": measured["surface_area_ratio"],
    }


def costs(folder: Path, runs: int) -> list[Row]:
    """Builds with each cost."""
    rows = []
    for name in COST_MESHES:
        mesh = mesh_of(folder, name)
        works: dict[str, Callable[[], Any]] = {
            cost: partial(umbel.cluster_mesh, mesh, threads=1, **settings)
            for cost, settings in COSTS.items()
        }
        works["connections"] = partial(normal_connections, mesh.positions, mesh.triangles, 4.0)
        made = in_turns(works, runs)
        _, connecting = made.pop("connections")
        for cost, (clusters, seconds) in made.items():
            row = {"mesh": name, "cost": cost, "seconds": seconds, "connecting": 0.0}
            if COSTS[cost].get("normal_weight"):
                row["connecting"] = connecting
            rows.append(row | quality(mesh, clusters))
            say(rows[-1])
    return rows


def costs_table(rows: Sequence[Row]) -> str:
    """Relative to builds without costs: geometric means over the meshes, and ranges."""
    lines = []
    for cost in COSTS:
        ratios: dict[str, list[float]] = {}
        for base in (row for row in rows if row["cost"] == "none"):
            own = next(r for r in rows if r["mesh"] == base["mesh"] and r["cost"] == cost)
            build = own["seconds"] - own["connecting"]
            ratios.setdefault("build", []).append(build / base["seconds"])
            for key in ("seconds", "clusters", "vertices", "boxes", "area"):
                ratios.setdefault(key, []).append(own[key] / base[key])
        lines.append(
            [
                cost,
                span(ratios["seconds"], ".1f"),
                span(ratios["build"], ".1f"),
                f"{geometric_mean(ratios['clusters']):.2f}",
                span(ratios["vertices"], ".3f"),
                span(ratios["boxes"], ".2f"),
                span(ratios["area"], ".2f"),
            ]
        )
    head = ["", "time", "without finding edges", "clusters"]
    return table([*head, "vertices per triangle", "overlap", "area ratio"], lines)


def span(values: Sequence[float], form: str, sign: str = "") -> str:
    """The least and the greatest."""
    low, high = (f"{value:{form}}" for value in (min(values), max(values)))
    return f"{low}{sign}" if low == high else f"{low} to {high}{sign}"


def large(folder: Path, runs: int) -> list[Row]:
    """What a cost takes and gains in nodes that do not fit a block.

    A build whose clusters are as large as blocks splits no other nodes. What it takes beyond one
    of its parts alone is the time of these nodes, and what the cost adds to that is the cost's. The
    gain is over a build that divides parts which were made without the cost.
    """
    rows = []
    for name in (*LARGE_MESHES, "terrain"):
        mesh = mesh_of(folder, name)
        for cost, limit in LARGE_COSTS.items():
            blocks = {"max_items": limit, "min_items": 1, "underfill_cost": 0.0, "threads": 1}
            order = np.arange(len(mesh.triangles))
            parts = umbel.build_clusters(**given(mesh, order, cost), **blocks)
            works: dict[str, Callable[[], Any]] = {}
            for what in (cost, "none"):
                boxes = given(mesh, parts.items, what)
                whole = partial(umbel.build_clusters, **boxes, **blocks)
                works[f"large {what}"] = whole
                works[f"parts {what}"] = partial(whole, segments=parts.ranges)
            build = partial(umbel.build_clusters, threads=1)
            works["all"] = partial(build, **given(mesh, parts.items, cost))
            made = in_turns(works, runs)
            seconds = {key: each[1] for key, each in made.items()}
            above = {
                what: seconds[f"large {what}"] - seconds[f"parts {what}"] for what in (cost, "none")
            }
            more = above[cost] - above["none"]
            blind = umbel.build_clusters(**given(mesh, order, "none"), **blocks)
            small = build(**given(mesh, blind.items, cost), segments=blind.ranges)
            row = {"mesh": name, "cost": cost, "limit": limit}
            row["share"] = above[cost] / seconds["all"]
            row["more"] = more / (seconds["all"] - more)
            row["all"] = quality(ordered(mesh, parts.items), made["all"][0])
            row["small"] = quality(ordered(mesh, blind.items), small)
            rows.append(row)
            say(row)
    return rows


def ordered(mesh: umbel.Mesh, triangles: np.ndarray) -> umbel.Mesh:
    return umbel.Mesh(mesh.positions, mesh.triangles[triangles])


def given(mesh: umbel.Mesh, triangles: np.ndarray, cost: str) -> Row:
    """What `build_clusters` takes for triangles in an order, and for a cost."""
    own = mesh.triangles[triangles]
    corners = mesh.positions[own]
    boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)])
    settings: Row = dict(COSTS[cost])
    if weight := settings.pop("normal_weight", 0.0):
        settings["connections"] = normal_connections(mesh.positions, own, weight)
    return {"boxes": boxes, "item_vertices": own} | settings


def large_table(rows: Sequence[Row]) -> str:
    """Ranges over the meshes; the gain relative to builds that ignore the cost in large nodes."""
    lines = []
    for cost, limit in LARGE_COSTS.items():
        own = [row for row in rows if row["cost"] == cost]
        gains = [
            span([row["all"][key] / row["small"][key] for row in own], ".3f")
            for key in ("vertices", "boxes", "area")
        ]
        share = span([round(100 * row["share"]) for row in own], "d", " %")
        more = span([round(100 * row["more"]) for row in own], "d", " %")
        lines.append([cost, f"{limit:,} items", share, more, *gains])
    head = ["", "nodes above", "share of the time", "time for the cost there"]
    return table([*head, "vertices per triangle", "overlap", "area ratio"], lines)


def spread_of(mesh: umbel.Mesh, clusters: umbel.Clusters) -> float:
    """1 minus the length of the mean unit normal of a cluster, averaged."""
    normals = face_normals(mesh.positions, mesh.triangles)[clusters.items]
    sums = np.add.reduceat(normals, clusters.ranges[:, 0])
    return float((1 - np.linalg.norm(sums / clusters.ranges[:, 1:], axis=1)).mean())


def weights(folder: Path) -> list[Row]:
    """How flat clusters are."""
    rows = []
    for name in WEIGHT_MESHES:
        mesh = mesh_of(folder, name)
        for weight, cost in WEIGHTS.items():
            clusters = umbel.cluster_mesh(mesh, threads=1, **COSTS[cost])
            cutoffs = umbel.cluster_bounds(mesh, clusters, threads=1).cone_cutoffs
            row = {"mesh": name, "weights": weight, "spread": spread_of(mesh, clusters)}
            row["cones"] = float((cutoffs < 1).mean())
            rows.append(row | quality(mesh, clusters))
            say(rows[-1])
    return rows


def weights_table(rows: Sequence[Row]) -> str:
    lines = []
    for row in rows:
        lines.append(
            [
                row["mesh"] if row["weights"] == "none" else "",
                row["weights"],
                f"{row['clusters']:,}",
                f"{row['vertices']:.3f}",
                f"{row['area']:.2f}",
                f"{row['spread']:.3f}",
                f"{row['cones']:.3f}",
            ]
        )
    head = ["", "weights", "clusters", "vertices per triangle", "area ratio", "spread", "cones"]
    return table(head, lines)


def vertices(folder: Path, runs: int) -> list[Row]:
    """With a limit on vertices, and without."""
    rows = []
    for name in VERTEX_MESHES:
        mesh = mesh_of(folder, name)
        build = partial(umbel.cluster_mesh, mesh, threads=1)
        works: dict[str, Callable[[], Any]] = {
            f"{items:g}, {missing:g}": partial(
                build,
                max_vertices=VERTICES,
                underfill_cost=items,
                vertex_underfill_cost=missing,
            )
            for items, missing in UNDERFILL
        }
        for preset, most in LIMITS:
            works[f"{preset} {most}"] = partial(build, max_vertices=most, preset=preset)
        for setting, (clusters, seconds) in in_turns(works, runs).items():
            row = {"mesh": name, "setting": setting, "ns": seconds / len(mesh.triangles) * 1e9}
            rows.append(row | quality(mesh, clusters))
            say(rows[-1])
    return rows


def underfill_table(rows: Sequence[Row]) -> str:
    """Means over the meshes, geometric for area and clusters."""
    lines = []
    for items, missing in UNDERFILL:
        own = [row for row in rows if row["setting"] == f"{items:g}, {missing:g}"]
        default = " (default)" if (items, missing) == (0.3, 0.5) else ""
        fill_of = fmean(row["vertex_fill"] for row in own)
        area = geometric_mean([row["area"] for row in own])
        count = geometric_mean([row["clusters"] for row in own])
        name = f"{items:g}, {missing:g}{default}"
        lines.append([name, f"{fill_of:.3f}", f"{area:.2f}", f"{count:,.0f}"])
    head = "`underfill_cost`, `vertex_underfill_cost`"
    return table([head, "vertex fill", "area ratio", "clusters"], lines)


def limits_table(rows: Sequence[Row]) -> str:
    """Times relative to the same preset without a limit."""
    lines = []
    for preset, most in LIMITS:
        own = [row for row in rows if row["setting"] == f"{preset} {most}"]
        base = [row for row in rows if row["setting"] == f"{preset} 0"]
        ratios = [row["ns"] / other["ns"] for row, other in zip(own, base, strict=True)]
        count = geometric_mean([row["clusters"] for row in own])
        nanoseconds = span([row["ns"] for row in own], ".0f")
        limit = f"at most {most}" if most else "no limit"
        lines.append([f"`{preset}`, {limit}", nanoseconds, span(ratios, ".2f"), f"{count:,.0f}"])
    head = ["", "ns per triangle", "relative to no limit", "clusters"]
    return table(head, lines)


def say(row: Row) -> None:
    shown = {
        key: {k: round(v, 4) for k, v in value.items()} if isinstance(value, dict) else value
        for key, value in row.items()
    }
    print(*(round(v, 4) if isinstance(v, float) else v for v in shown.values()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--docs", action="store_true", help="fill docs/clusters.md")
    args = parser.parse_args()
    texts = {}
    if "costs" in args.parts:
        texts["costs"] = costs_table(costs(args.folder, args.runs))
    if "large" in args.parts:
        texts["large nodes"] = large_table(large(args.folder, args.runs))
    if "weights" in args.parts:
        texts["weights"] = weights_table(weights(args.folder))
    if "vertices" in args.parts:
        rows = vertices(args.folder, args.runs)
        texts["underfill"] = underfill_table(rows)
        texts["limits"] = limits_table(rows)
    for part, text in texts.items():
        print(f"\n{part}\n\n{text}")
    if args.docs:
        fill(ROOT / "docs" / "clusters.md", texts, "bench/cluster_costs.py")


if __name__ == "__main__":
    main()
