"""`umbel kdtree`: builds one kd-tree and measures it."""

from __future__ import annotations

import enum
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from umbel.cli.inputs import AllowOutside, MeshFile, load_mesh
from umbel.cli.outputs import check_output
from umbel.cli.run import Json, Threads, ends_cleanly, heard, show
from umbel.cli.structures import FLAGS, Compact, Costs, DropInvalid, parse_cost, ray_speeds


class Traversal(str, enum.Enum):
    stack = "stack"
    ropes = "ropes"
    short_stack = "short-stack"


@ends_cleanly(FLAGS)
def command(
    # Long: typer reads the flags and their help from the signature.
    source: MeshFile,
    builder: Annotated[str, typer.Option(help="exact or binned.")] = "exact",
    ropes: Annotated[bool, typer.Option(help="Trace by ropes instead of with a stack.")] = False,
    traversal: Annotated[
        Traversal | None, typer.Option(help="How rays are traced, in place of --ropes.")
    ] = None,
    cost: Costs = "3,2",
    max_depth: Annotated[
        int | None, typer.Option(metavar="N", help="Deepest level of a leaf, 1 to 64.")
    ] = None,
    target_leaf_size: Annotated[
        int | None,
        typer.Option(metavar="N", help="So few triangles are not split any more, 0 to 255."),
    ] = None,
    empty_bonus: Annotated[
        float | None, typer.Option(metavar="F", help="Bonus for cutting off empty space, 0 to 0.9.")
    ] = None,
    bad_refines: Annotated[
        int | None,
        typer.Option(metavar="N", help="Splits on a path that may cost more than a leaf, 0 to 64."),
    ] = None,
    max_references: Annotated[
        float | None, typer.Option(metavar="F", help="Most references a triangle, 1 to 64.")
    ] = None,
    bins: Annotated[
        int | None, typer.Option(metavar="N", help="binned: bins an axis, 4 to 256.")
    ] = None,
    compact: Compact = False,
    drop_invalid: DropInvalid = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="OUT.umkd", help="Keep it.")
    ] = None,
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

    mesh = load_mesh(source, allow_outside=allow_outside, drops=drop_invalid, threads=threads)
    origin, mesh = mesh.origin, replace(mesh, origin=zero_origin())  # for rays in float32
    with Bar() as bar:
        began = time.perf_counter()
        tree = KdTree(
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
            progress=bar,
            threads=threads,
        )
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
