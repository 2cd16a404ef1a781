"""`umbel kdtree`: builds one kd-tree and measures it."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from umbel.cli.inputs import AllowOutside, MeshFile, empty_mesh, load_mesh
from umbel.cli.options import Traversal, file_to_keep, option
from umbel.cli.outputs import check_output
from umbel.cli.run import Json, Threads, ends_cleanly, heard, show, warn_no_effect
from umbel.cli.structures import FLAGS, Compact, Costs, DropInvalid, parse_cost, ray_speeds

if TYPE_CHECKING:
    from umbel.geometry.mesh import Mesh
    from umbel.geometry.repair import Progress


@ends_cleanly(FLAGS)
def command(
    # Long: typer reads the flags and their help from the signature.
    source: MeshFile,
    builder: str = option("exact", None, "exact or binned."),
    ropes: bool = option(False, None, "Trace by ropes instead of with a stack."),
    traversal: Traversal | None = option(None, None, "How rays are traced, in place of --ropes."),
    cost: Costs = "3,2",
    max_depth: int | None = option(None, "N", "Deepest level of a leaf, 1 to 64."),
    target_leaf_size: int | None = option(
        None, "N", "So few triangles are not split any more, 0 to 255."
    ),
    empty_bonus: float | None = option(None, "F", "Bonus for cutting off empty space, 0 to 0.9."),
    bad_refines: int | None = option(
        None, "N", "Splits on a path that may cost more than a leaf, 0 to 64."
    ),
    max_references: float | None = option(None, "F", "Most references a triangle, 1 to 64."),
    bins: int | None = option(None, "N", "binned: bins an axis, 4 to 256."),
    compact: Compact = False,
    drop_invalid: DropInvalid = False,
    output: Path | None = file_to_keep("OUT.umkd"),
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Build an SAH kd-tree over a mesh and measure it: its cost, and its rays a second (three views
    of 512 x 512 pixels, and a diffuse bounce from what they hit)."""
    if output is not None:
        check_output(output, ".umkd", inputs=[source])
    costs = parse_cost(cost)

    from umbel.accel.kdtree import KdTree
    from umbel.cli.progress import Bar
    from umbel.geometry.origin import warn_of_origin, zero_origin

    def build(mesh: Mesh, progress: Progress | None = None) -> KdTree:
        return KdTree(
            mesh,
            builder=builder,
            ropes=ropes,
            traversal=None if traversal is None else traversal.value,
            cost=costs,
            max_depth=max_depth,
            target_leaf_size=target_leaf_size,
            empty_bonus=empty_bonus,
            bad_refines=bad_refines,
            max_references=max_references,
            bins=bins,
            compact=compact,
            invalid="drop" if drop_invalid else "refuse",
            progress=progress,
            threads=threads,
        )

    build(empty_mesh())
    if bins is not None and builder == "exact":
        warn_no_effect("--bins", "it is for --builder binned, not exact")
    if ropes and traversal not in (None, Traversal.ropes):
        warn_no_effect("--ropes", f"--traversal {traversal.value} is given")
    mesh = load_mesh(source, allow_outside=allow_outside, drops=drop_invalid, threads=threads)
    origin, mesh = mesh.origin, replace(mesh, origin=zero_origin())  # for rays in float32
    with Bar() as bar:
        began = time.perf_counter()
        tree = build(mesh, bar)
        built = time.perf_counter()
    if output is not None:
        tree.save(output)
        warn_of_origin(output, origin)
    found = tree.statistics()
    result: dict[str, Any] = {
        "input": source,
        "output": None if output is None else str(output),
        "builder": builder,
        "traversal": tree.traversal,
        "triangles": len(mesh.triangles),
        "origin": origin.tolist(),
        **found,
        "references_per_triangle": found["references"] / max(len(mesh.triangles), 1),
        # Surfaces within a node's cell that are not in its subtree: none, as cells do not overlap.
        "epo": 0.0,
        "build_seconds": built - began,
    }
    result |= ray_speeds(tree, mesh, threads)
    if output is not None:
        result["file_bytes"] = output.stat().st_size
    result["warnings"] = heard
    show(result, as_json, source)
