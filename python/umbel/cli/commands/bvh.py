"""`umbel bvh`: builds one acceleration structure and measures it."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from umbel.cli.inputs import AllowOutside, MeshFile, empty_mesh, load_mesh
from umbel.cli.options import Distance, file_to_keep, option
from umbel.cli.outputs import check_output
from umbel.cli.run import Device, Json, Threads, ends_cleanly, fail, heard, show, warn_no_effect
from umbel.cli.structures import FLAGS, Compact, Costs, DropInvalid, parse_cost, ray_speeds

if TYPE_CHECKING:
    from umbel.accel.bvh import Bvh
    from umbel.accel.tree_options import TreeOptions
    from umbel.accel.trees import KaryTree
    from umbel.geometry.mesh import Mesh
    from umbel.geometry.repair import Progress


def _knob(metavar: str | None, text: str, value: Any = None) -> Any:
    """An option of one builder."""
    return option(value, metavar, text, rich_help_panel="Settings of builders")


_BUILDERS = {
    "bins": ["binned"],
    "spatial_budget": ["sbvh"],
    "spatial_overlap": ["sbvh"],
    "morton_bits": ["lbvh"],
    "hlbvh_bits": ["hlbvh"],
    "clusters": ["kmeans"],
    "candidates": ["kmeans"],
    "iterations": ["kmeans"],
    "distance": ["kmeans"],
    "forwarded_clusters": ["kmeans"],
    "aac_leaf_size": ["aac"],
    "aac_epsilon": ["aac"],
    "ploc_radius": ["ploc", "hploc"],
    "ploc_sweep": ["ploc"],
    "atrbvh_bits": ["atrbvh"],
    "treelet_size": ["atrbvh"],
    "treelet_rounds": ["atrbvh"],
}
"""The builders that have an option; all have those that are not listed."""
_PRESETS = {"fast": "lbvh", "quality": "binned", "best": "sbvh"}
_NOT_KARY = ("max_depth", "reinsertion_rounds", "forwarded_clusters")
"""Options of the binary tree over the clusters, which --kary does not build."""


@ends_cleanly(FLAGS)
def command(
    # Long: typer reads the flags and their help from the signature.
    source: MeshFile,
    builder: str = option(
        "quality",
        None,
        "fast, quality or best; a builder: sweep, binned, sbvh, lbvh, kmeans, "
        "agglomerative, aac, insertion, ...; or kmeans-q1 to kmeans-q5, aac-fast, aac-hq.",
    ),
    device: Device = option(Device.cpu, None, "Where to work."),
    width: int = option(8, "2|4|8", "Children a node."),
    cost: Costs = "3,2",
    max_leaf_size: int = option(8, "N", "Most triangles a leaf."),
    max_depth: int | None = option(None, "N", "Deepest level of a leaf, 8 to 255."),
    compact: Compact = False,
    drop_invalid: DropInvalid = False,
    reinsertion_rounds: int | None = _knob(
        "N", "Rounds of reinsertion, after any builder: 0 to 64."
    ),
    bins: int | None = _knob("N", "binned: bins an axis, 4 to 256."),
    spatial_budget: float | None = _knob(
        "F", "sbvh: references beyond the triangles, as a fraction: 0 to 4."
    ),
    spatial_overlap: float | None = _knob(
        "F", "sbvh: overlap from which on spatial splits are tried: 0 to 1."
    ),
    morton_bits: int | None = _knob("30|60|63", "lbvh: bits of the code."),
    hlbvh_bits: int | None = _knob("N", "hlbvh: leading bits of the code built by SAH, 3 to 30."),
    clusters: int | None = _knob("K", "kmeans: clusters a node, 2 to 1024."),
    candidates: int | None = _knob("P", "kmeans: candidates a representative, 1 to 64."),
    iterations: int | None = _knob("I", "kmeans: Lloyd iterations, 0 to 100."),
    distance: Distance | None = _knob(None, "kmeans: distance of boxes, by means or by medians."),
    kary: bool = _knob(None, "kmeans: the clusters themselves, up to K children a node.", False),
    forwarded_clusters: int | None = _knob(
        "N", "kmeans: nodes a treelet forwards, 0 to 64; 1 as published."
    ),
    aac_leaf_size: int | None = _knob(
        "N", "aac: fewer triangles are not halved any more, 2 to 128."
    ),
    aac_epsilon: float | None = _knob(
        "E", "aac: n triangles forward some n^(0.5-E) nodes, 0 to 0.5."
    ),
    ploc_radius: int | None = _knob("N", "ploc: neighbours searched each way, 1 to 128."),
    ploc_sweep: int | None = _knob(
        "N", "ploc: full sweep above so many triangles, 0 to 255; 0 as published."
    ),
    atrbvh_bits: int | None = _knob("N", "atrbvh: as --hlbvh-bits, to begin with; 0 as published."),
    treelet_size: int | None = _knob("N", "atrbvh: leaves of a treelet, 3 to 15."),
    treelet_rounds: int | None = _knob("N", "atrbvh: rounds, 1 to 16."),
    output: Path | None = file_to_keep("OUT.umbvh"),
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Build a bounding volume hierarchy over a mesh and measure it: its cost, and its rays a second
    (three views of 512 x 512 pixels, and a diffuse bounce from what they hit)."""
    if device is Device.cuda and (output is not None or compact or kary or width != 8):
        fail("--device cuda has neither -o nor --compact nor --kary nor other widths than 8")
    if output is not None:
        check_output(output, ".umbvh", inputs=[source])
    if kary and not builder.startswith("kmeans"):
        fail(f"--kary is of the builder kmeans, not of {builder}")
    costs = parse_cost(cost)
    options: TreeOptions = {
        "cost": costs,
        "max_leaf_size": max_leaf_size,
        "max_depth": max_depth,
        "invalid": "drop" if drop_invalid else "refuse",
        "reinsertion_rounds": reinsertion_rounds,
        "bins": bins,
        "spatial_budget": spatial_budget,
        "spatial_overlap": spatial_overlap,
        "morton_bits": morton_bits,
        "hlbvh_bits": hlbvh_bits,
        "clusters": clusters,
        "candidates": candidates,
        "iterations": iterations,
        "distance": None if distance is None else distance.value,
        "forwarded_clusters": forwarded_clusters,
        "aac_leaf_size": aac_leaf_size,
        "aac_epsilon": aac_epsilon,
        "ploc_radius": ploc_radius,
        "ploc_sweep": ploc_sweep,
        "atrbvh_bits": atrbvh_bits,
        "treelet_size": treelet_size,
        "treelet_rounds": treelet_rounds,
    }

    from umbel.accel.bvh import Bvh
    from umbel.accel.trees import Bvh2, build_bvh2, build_kary
    from umbel.cli.on_device import bvh_on_device, check_device
    from umbel.cli.progress import Bar
    from umbel.geometry.origin import warn_of_origin, zero_origin

    def build(mesh: Mesh, progress: Progress | None = None) -> Bvh2 | KaryTree:
        make = build_kary if kary else build_bvh2
        return make(mesh, builder=builder, progress=progress, threads=threads, **options)

    def widen(tree: Bvh2 | KaryTree, mesh: Mesh) -> Bvh:
        return Bvh.from_tree(tree, mesh, width=width, compact=compact, threads=threads)

    given: dict[str, Any] = {**options}
    del given["invalid"]
    if device is Device.cuda:
        check_device(given)
    else:
        widen(build(empty_mesh()), empty_mesh())
    _warn_of_flags(builder, device, kary, options)
    mesh = load_mesh(source, allow_outside=allow_outside, drops=drop_invalid, threads=threads)
    origin, mesh = mesh.origin, replace(mesh, origin=zero_origin())  # for rays in float32
    result: dict[str, Any] = {
        "input": source,
        "output": None if output is None else str(output),
        "builder": builder,
        "triangles": len(mesh.triangles),
        "origin": origin.tolist(),
    }
    if device is Device.cuda:
        result |= bvh_on_device(mesh, builder, given, threads)
        result["warnings"] = heard
        show(result, as_json, source)
        return
    with Bar() as bar:
        began = time.perf_counter()
        tree = build(mesh, bar)
        built = time.perf_counter()
        bvh = widen(tree, mesh)
        widened = time.perf_counter()
    if output is not None:
        bvh.save(output)
        warn_of_origin(output, origin)
    found, wide = tree.statistics(costs), bvh.statistics()
    result |= {
        "width": width,
        "nodes": found["nodes"],
        "leaves": found["leaves"],
        "max_depth": found["max_depth"],
        "references": found["references"],
        "sah_cost": found["sah_cost"],
        "epo": tree.epo(costs, threads=threads) if isinstance(tree, Bvh2) else None,
        "build_seconds": built - began,
        "widen_seconds": widened - built,
        "wide_nodes": wide["nodes"],
        "bytes": wide["bytes"],
    }
    result |= ray_speeds(bvh, mesh, threads)
    if output is not None:
        result["file_bytes"] = output.stat().st_size
    result["warnings"] = heard
    show(result, as_json, source)


def _warn_of_flags(builder: str, device: Device, kary: bool, options: TreeOptions) -> None:
    """Warns of settings that have no effect on this builder."""
    from umbel.cli.on_device import BUILDERS

    presets = BUILDERS if device is Device.cuda else _PRESETS
    built_by = presets.get(builder, builder).partition("-")[0]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        builders = _BUILDERS.get(name, [built_by])
        if value is not None and built_by not in builders:
            warn_no_effect(flag, f"it is for --builder {builders[0]}, not {builder}")
        elif value is not None and kary and name in _NOT_KARY:
            warn_no_effect(flag, "it is not for --kary")
