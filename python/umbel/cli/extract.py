"""`umbel extract`: one cut of an asset as an ordinary mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .run import USAGE, Json, Threads, check_output, ends_cleanly, fail, show


@ends_cleanly
def command(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Asset (.umbel).")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="OUT", help="Mesh to write: .glb .ply .obj.")
    ],
    error: Annotated[
        float | None,
        typer.Option(metavar="E", help="Coarsest cut with at most this error, in the mesh's unit."),
    ] = None,
    triangles: Annotated[
        int | None,
        typer.Option(metavar="N", help="Finest cut with at most so many triangles, if any has."),
    ] = None,
    level: Annotated[
        int | None, typer.Option(metavar="L", help="A level as it was built; 0: the mesh itself.")
    ] = None,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Write one cut of an asset as an ordinary mesh, attributes and materials kept; where it has
    instances, all of them."""
    if sum(value is not None for value in (error, triangles, level)) != 1:
        fail("give exactly one of --error, --triangles and --level", USAGE)
    check_output(output, ".glb", ".ply", ".obj")

    from ..asset import Asset
    from ..io import save

    asset = Asset(path)
    shown = asset.scene_cuts(error=error, triangles=triangles, level=level)
    mesh = asset.scene_mesh(shown)
    save(output, mesh)
    result = {
        "triangles": len(mesh.triangles),
        "vertices": len(mesh.positions),
        "max_error": asset.scene_error(shown),
        "clusters": sum(len(one.cut) for one in shown),
        "file_bytes": output.stat().st_size,
    }
    show(result, as_json, str(output))
