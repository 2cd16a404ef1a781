"""`umbel cluster`: clusters of a mesh, and how good they are."""

from __future__ import annotations

import enum
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from umbel.cli.inputs import AllowOutside, MeshFile, load_mesh
from umbel.cli.outputs import check_output
from umbel.cli.run import Device, Json, Threads, ends_cleanly, fail, heard, show

if TYPE_CHECKING:
    from umbel.cluster.clusters import Clusters
    from umbel.geometry.mesh import Mesh


class Method(str, enum.Enum):
    bisect = "bisect"
    morton = "morton"
    hybrid = "hybrid"


class Preset(str, enum.Enum):
    quality = "quality"
    fast = "fast"
    exact = "exact"


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
    method: Annotated[
        Method | None,
        typer.Option(
            help="Bisection by cost (on cpu the default; cpu only), runs of the Morton order, or "
            "both (hybrid; on cuda the default)."
        ),
    ] = None,
    device: Annotated[Device, typer.Option(help="Where to work.")] = Device.cpu,
    preset: Annotated[
        Preset, typer.Option(help="Where limits and penalties start from.")
    ] = Preset.quality,
    max_triangles: Annotated[
        int, typer.Option(metavar="N", help="Most triangles a cluster.")
    ] = 128,
    min_triangles: Annotated[
        int | None, typer.Option(metavar="N", help="Fewest triangles of all clusters but one.")
    ] = None,
    max_vertices: Annotated[
        int, typer.Option(metavar="N", help="Most unique vertices a cluster; 0: no limit.")
    ] = 0,
    underfill: Annotated[
        float | None, typer.Option(metavar="C", help="Price of missing triangles, 0 to 1.")
    ] = None,
    overlap: Annotated[
        float | None, typer.Option(metavar="C", help="Price of overlapping boxes, 0 to 1.")
    ] = None,
    vertex_underfill: Annotated[
        float | None, typer.Option(metavar="C", help="Price of missing vertices, 0 to 1.")
    ] = None,
    presplit: Annotated[
        int | None,
        typer.Option(metavar="N", help="Halve larger parts without a search; 0: never."),
    ] = None,
    weights: Annotated[
        str,
        typer.Option(
            metavar="none|shared-vertices|normals|MIX",
            help="What keeps triangles together besides their positions; a mix has weights, as in "
            "shared-vertices=0.3,normals=4.",
        ),
    ] = "none",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="A .glb shows the clusters in colours; a .npz holds `items` and `offsets`.",
        ),
    ] = None,
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Cluster a mesh and say how good the clusters are."""
    if device is Device.cuda and method is Method.bisect:
        fail("--device cuda has the methods morton and hybrid")
    if output is not None:
        check_output(output, ".glb", ".npz", inputs=[source])

    from umbel.cli.on_device import cluster_on_device
    from umbel.cli.progress import Bar
    from umbel.cluster.clusters import cluster_mesh
    from umbel.cluster.weights import weights_of
    from umbel.geometry.repair import weld

    mix = weights_of(weights)

    mesh = load_mesh(source, allow_outside=allow_outside, threads=threads)
    # Vertices count by what they are, not by how a file stores them; triangles keep their order.
    mesh = weld(mesh, threads=threads)
    with Bar() as bar:
        began = time.perf_counter()
        if device is Device.cuda:
            clusters = cluster_on_device(
                mesh,
                (method or Method.hybrid).value,
                max_triangles,
                min_triangles,
                max_vertices,
                underfill,
                threads,
            )
        else:
            clusters = cluster_mesh(
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
                method=(method or Method.bisect).value,
                progress=bar,
                threads=threads,
            )
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
