"""Settings of kd-trees over triangles: what each costs and gains.

    python bench/kdtree_settings.py [--runs N] [--share F] [--docs] [-o DIR] MESH...

One thread, processor time, medians of runs that take turns: the build, and primary rays of the
three views of `umbel bench bvh`, through a share of the pixels, with one diffuse ray from each hit.
Every tree must give the same hits. Writes kdtree-settings.csv into DIR; --docs also puts the table,
means over the meshes relative to the defaults, into docs/kdtree.md, from DIR alone if no mesh is
named.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from docs_tables import ROOT, fill, table
from structures import in_turns, mean_of, rays_of, read, write

import umbel
from umbel.bench.bvh.scenes import scene

DEFAULT = "defaults"
SETTINGS: dict[str, dict[str, Any]] = {
    DEFAULT: {},
    "`target_leaf_size` 4": {"target_leaf_size": 4},
    "`target_leaf_size` 8": {"target_leaf_size": 8},
    "`target_leaf_size` 16": {"target_leaf_size": 16},
    "`empty_bonus` 0": {"empty_bonus": 0.0},
    "`empty_bonus` 0.5": {"empty_bonus": 0.5},
    "`empty_bonus` 0.8": {"empty_bonus": 0.8},
    "`bad_refines` 0": {"bad_refines": 0},
    "`bad_refines` 8": {"bad_refines": 8},
    "`max_depth` 16": {"max_depth": 16},
    "`max_depth` 20": {"max_depth": 20},
    "`max_depth` 64": {"max_depth": 64},
}


def measure(path: Path, runs: int, share: float) -> list[dict[str, Any]]:
    """A row for each setting."""
    on = scene(path.stem, lambda: umbel.load(path))
    rays = rays_of(on, share)
    makers = {
        name: partial(umbel.KdTree, on.mesh, threads=1, **settings)
        for name, settings in SETTINGS.items()
    }
    built, times = in_turns(on, makers, rays, runs)
    rows = []
    triangles = len(on.mesh.triangles)
    for name, own in times.items():
        found = built[name].statistics()
        rows.append(
            {
                "mesh": path.stem,
                "triangles": triangles,
                "settings": name,
                "build_seconds": own["build"],
                "nodes_a_triangle": found["nodes"] / triangles,
                "references_a_triangle": found["references"] / triangles,
                "max_depth": found["max_depth"],
                "sah_cost": found["sah_cost"],
                "primary_mrays": len(rays["primary"][0]) / own["primary"] * 1e-6,
                "bounce_mrays": len(rays["bounce"][0]) / own["bounce"] * 1e-6,
            }
        )
        print(*rows[-1].values(), sep="\t", flush=True)
    return rows


def relative(rows: list[dict[str, Any]]) -> str:
    """Geometric means relative to the defaults, as Markdown."""
    fields = {
        "build time": "build_seconds",
        "nodes": "nodes_a_triangle",
        "references": "references_a_triangle",
        "SAH cost": "sah_cost",
        "primary rays/s": "primary_mrays",
        "bounce rays/s": "bounce_mrays",
    }
    own = {name: [row for row in rows if row["settings"] == name] for name in SETTINGS}
    lines = [
        [
            name,
            *(f"{mean_of(some, key) / mean_of(own[DEFAULT], key):.2f}" for key in fields.values()),
        ]
        for name, some in own.items()
    ]
    return table(["", *fields], lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--share", type=float, default=0.05)
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("-o", "--output", type=Path, default=Path("structures"))
    args = parser.parse_args()
    file = args.output / "kdtree-settings.csv"
    args.output.mkdir(parents=True, exist_ok=True)
    if args.meshes:
        write([row for path in args.meshes for row in measure(path, args.runs, args.share)], file)
    rows = read(file)
    if rows and args.docs:
        fill(ROOT / "docs" / "kdtree.md", {"settings": relative(rows)})
    elif rows:
        print(relative(rows))


if __name__ == "__main__":
    main()
