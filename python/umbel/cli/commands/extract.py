"""`umbel extract`: one cut of an asset as an ordinary mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from umbel.cli.options import option
from umbel.cli.outputs import check_output
from umbel.cli.run import USAGE, Json, Threads, ends_cleanly, fail, heard, show


@ends_cleanly()
def command(
    path: Annotated[str, typer.Argument(metavar="FILE", help="Asset (.umbel).")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="OUT", help="Mesh to write: .glb .gltf .ply .obj."),
    ],
    error: float | None = option(
        None, "E", "Coarsest cut with at most this error, in the mesh's unit; inf: the coarsest."
    ),
    triangles: int | None = option(None, "N", "Finest cut with at most so many triangles."),
    level: int | None = option(None, "L", "A level as it was built; 0: the mesh itself."),
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Write one cut of an asset as an ordinary mesh, attributes and materials kept; where it has
    instances, all of them."""
    if sum(value is not None for value in (error, triangles, level)) != 1:
        fail("give exactly one of --error, --triangles and --level", USAGE)
    check_output(output, ".glb", ".gltf", ".ply", ".obj", inputs=[path])
    _check_cut(error, triangles, level)

    from umbel.io import save
    from umbel.lod.asset import Asset

    asset = Asset(path)
    shown = asset.scene_cuts(error=error, triangles=triangles, level=level)
    scene = asset.scene_of(shown)
    save(output, scene)
    meshes = [scene.meshes[instance.mesh] for instance in scene.instances]
    result = {
        "input": path,
        "output": str(output),
        "triangles": sum(len(mesh.triangles) for mesh in meshes),
        "vertices": sum(len(mesh.positions) for mesh in meshes),
        "max_error": asset.scene_error(shown),
        "clusters": sum(len(one.cut) for one in shown),
        "file_bytes": output.stat().st_size,
        "warnings": heard,
    }
    show(result, as_json, str(output))


def _check_cut(error: float | None, triangles: int | None, level: int | None) -> None:
    """Refuses, before anything is read, what no asset has."""
    if error is not None and not error >= 0:
        fail(f"--error must be 0 or more, not {error:g}")
    if triangles is not None and triangles < 1:
        fail(f"--triangles must be at least 1, not {triangles}")
    if level is not None and level < 0:
        fail(f"--level must be 0 (the mesh itself) or more, not {level}")
