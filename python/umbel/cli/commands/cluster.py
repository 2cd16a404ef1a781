"""`umbel cluster`: clusters of a mesh, and how good they are."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from umbel.cli.inputs import AllowOutside, MeshFile, empty_mesh, load_mesh
from umbel.cli.options import Method, Preset, option
from umbel.cli.outputs import check_output
from umbel.cli.run import Device, Json, Threads, ends_cleanly, fail, heard, show, warn_no_effect

if TYPE_CHECKING:
    from umbel.cluster.clusters import Clusters
    from umbel.geometry.mesh import Mesh
    from umbel.geometry.repair import Progress


_FLAGS = {
    "max_items": "--max-triangles",
    "min_items": "--min-triangles",
    "underfill_cost": "--underfill",
    "overlap_cost": "--overlap",
    "vertex_underfill_cost": "--vertex-underfill",
    "presplit_threshold": "--presplit",
}


@ends_cleanly(_FLAGS)
def command(
    # Long: typer reads the flags and their help from the signature.
    source: MeshFile,
    method: Method | None = option(
        None,
        None,
        "Bisection by cost (on cpu the default; cpu only), runs of the Morton order, or "
        "both (hybrid; on cuda the default).",
    ),
    device: Device = option(Device.cpu, None, "Where to work."),
    preset: Preset = option(Preset.quality, None, "Where limits and penalties start from."),
    max_triangles: int = option(128, "N", "Most triangles a cluster."),
    min_triangles: int | None = option(None, "N", "Fewest triangles of all clusters but one."),
    max_vertices: int = option(0, "N", "Most unique vertices a cluster; 0: no limit."),
    underfill: float | None = option(None, "C", "Price of missing triangles, 0 to 1."),
    overlap: float | None = option(None, "C", "Price of overlapping boxes, 0 to 1."),
    vertex_underfill: float | None = option(None, "C", "Price of missing vertices, 0 to 1."),
    presplit: int | None = option(None, "N", "Halve larger parts without a search; 0: never."),
    weights: str = option(
        "none",
        "none|shared-vertices|normals|MIX",
        "What keeps triangles together besides their positions; a mix has weights, as in "
        "shared-vertices=0.3,normals=4.",
    ),
    output: Path | None = option(
        None,
        "OUT",
        "A .glb shows the clusters in colours; a .npz holds `items` and `offsets`.",
        "-o",
        "--output",
    ),
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Cluster a mesh and say how good the clusters are."""
    if device is Device.cuda and method is Method.bisect:
        fail("--device cuda has the methods morton and hybrid")
    if method is None:
        method = Method.hybrid if device is Device.cuda else Method.bisect
    given = {
        "--preset": preset is not Preset.quality,
        "--min-triangles": min_triangles,
        "--max-vertices": max_vertices,
        "--underfill": underfill,
        "--overlap": overlap,
        "--vertex-underfill": vertex_underfill,
        "--presplit": presplit,
        "--weights": weights != "none",
    }
    if output is not None:
        check_output(output, ".glb", ".npz", inputs=[source])

    from umbel.cli.on_device import check_device, cluster_on_device
    from umbel.cli.progress import Bar
    from umbel.cluster.clusters import cluster_mesh
    from umbel.cluster.weights import weights_of
    from umbel.geometry.repair import weld

    mix = weights_of(weights)
    if method is not Method.bisect:
        mix = {}  # has no effect, as a warning says

    def build(mesh: Mesh, progress: Progress | None = None) -> Clusters:
        return cluster_mesh(
            mesh,
            max_triangles,
            max_vertices,
            preset.value,
            min_triangles=min_triangles,
            underfill_cost=underfill,
            overlap_cost=overlap,
            vertex_underfill_cost=vertex_underfill,
            presplit_threshold=presplit,
            shared_vertex_weight=mix.get("shared-vertices", 0.0),
            normal_weight=mix.get("normals", 0.0),
            method=method.value,
            progress=progress,
            threads=threads,
        )

    if device is Device.cuda:
        check_device()
    else:
        build(empty_mesh())
    _warn_of_flags(method, device, [flag for flag, value in given.items() if value])

    mesh = load_mesh(source, allow_outside=allow_outside, threads=threads)
    # Vertices count by what they are, not by how a file stores them; triangles keep their order.
    mesh = weld(mesh, threads=threads)
    with Bar() as bar:
        began = time.perf_counter()
        if device is Device.cuda:
            clusters = cluster_on_device(
                mesh,
                method.value,
                max_triangles,
                min_triangles,
                max_vertices,
                underfill,
                threads,
            )
        else:
            clusters = build(mesh, bar)
        seconds = time.perf_counter() - began
    written = None if output is None else str(output)
    result = {"input": source, "output": written, **clusters.metrics()}
    count = len(mesh.triangles)
    result |= {
        "triangles": count,
        "seconds": seconds,
        "triangles_per_second": count / seconds if seconds > 0 else 0.0,
    }
    if output is not None:
        _write(output, mesh, clusters)
        result["file_bytes"] = output.stat().st_size
    result["warnings"] = heard
    show(result, as_json, source)


_TAKEN = {Method.hybrid: ["--preset", "--min-triangles", "--max-vertices"], Method.morton: []}
"""Flags of methods that do not have all."""
_TAKEN_ON_DEVICE = ["--min-triangles", "--max-vertices", "--underfill"]
"""Those of the hybrid method."""


def _warn_of_flags(method: Method, device: Device, given: list[str]) -> None:
    """Warns of flags that have no effect on this method."""
    taken, named = _TAKEN.get(method, given), method.value
    if device is Device.cuda and method is Method.hybrid:
        taken, named = _TAKEN_ON_DEVICE, f"{named} with --device cuda"
    for flag in given:
        if flag not in taken:
            methods = "bisect and hybrid" if flag in _TAKEN[Method.hybrid] else "bisect"
            warn_no_effect(flag, f"it is for --method {methods}, not {named}")
        elif flag == "--vertex-underfill" and "--max-vertices" not in given:
            warn_no_effect(flag, "it is for --max-vertices")


def _write(output: Path, mesh: Mesh, clusters: Clusters) -> None:
    if output.suffix.lower() == ".npz":
        import numpy as np

        from umbel.io.files import replacing

        arrays: dict[str, Any] = {"items": clusters.items, "offsets": clusters.offsets}
        with replacing(output) as file:
            np.savez(file, **arrays)
        return
    from umbel.cluster.colors import colored_clusters
    from umbel.io import save

    save(output, colored_clusters(mesh, clusters))
