"""`umbel export`: an asset for other viewers."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from umbel.cli.options import ExportFormat, Up, option, switch
from umbel.cli.outputs import check_folder, check_output
from umbel.cli.progress import Bar
from umbel.cli.run import USAGE, Json, Threads, ends_cleanly, fail, heard, is_asset, show


@ends_cleanly()
def command(
    path: Annotated[str, typer.Argument(metavar="FILE", help="Asset (.umbel).")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="OUT", help="Folder to write, or .glb."),
    ],
    format: ExportFormat | None = option(
        None,
        None,
        "3D Tiles 1.1 (default), glTF with MSFT_lod (default for .glb), or a page with the viewer.",
    ),
    tile_triangles: int | None = option(
        None,
        "N",
        "3dtiles: a cell with more of the asset's triangles is split.  [default: 32768]",
        min=1,
    ),
    implicit_above: int | None = option(
        None, "N", "3dtiles: with more tiles, write implicit tiling.  [default: 10000]", min=0
    ),
    skirts: bool = switch(
        "--skirts", "3dtiles: strips along tiles' borders that cover gaps between levels."
    ),
    flatten: bool = switch(
        "--flatten", "Store each instance, for viewers without EXT_mesh_gpu_instancing."
    ),
    up: Up | None = option(
        None, None, "3dtiles: axis to the zenith; if not given, what is known of the source."
    ),
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Write an asset for other viewers: a folder of 3D Tiles, one glTF file with a few levels, or a
    web page. The result takes its name when all of it is written."""
    if not is_asset(path):
        fail(f"{path}: only .umbel files are exported; `umbel build` makes one of a mesh")
    suffix = output.suffix.lower()
    if format is None and suffix in (".gltf", ".obj", ".ply"):
        fail(f"{output}: a folder or a .glb is written; `umbel extract` writes {suffix}", USAGE)
    is_glb = suffix == ".glb"
    chosen = format or (ExportFormat.glb if is_glb else ExportFormat.tiles)
    counts = {"tile_triangles": tile_triangles, "implicit_above": implicit_above}
    given = {name: count for name, count in counts.items() if count is not None}
    if chosen is not ExportFormat.tiles and (given or skirts or up is not None):
        flags = "--tile-triangles, --implicit-above, --skirts and --up"
        fail(f"{flags} are for --format 3dtiles, not {chosen.value}", USAGE)
    if chosen is ExportFormat.viewer and flatten:
        fail("--flatten is for --format 3dtiles and glb, not viewer", USAGE)
    if chosen is ExportFormat.glb:
        check_output(output, ".glb", inputs=[path])
    else:
        check_folder(output.absolute().parent, f"{output}: ")
    started = time.perf_counter()
    with Bar() as bar:
        if chosen is ExportFormat.glb:
            result = _glb(path, output, flatten, bar)
        elif chosen is ExportFormat.viewer:
            result = _viewer(path, output)
        else:
            from umbel.export.tiles import export_tiles

            report = export_tiles(
                path,
                output,
                **given,
                skirts=skirts,
                flatten=flatten,
                up=None if up is None else up.value,
                progress=bar,
                threads=threads,
            )
            result = dataclasses.asdict(report)
    seconds = time.perf_counter() - started
    head = {"input": path, "output": str(output), "format": chosen.value}
    show(head | result | {"seconds": seconds, "warnings": heard}, as_json, str(output))


def _glb(path: str, output: Path, flatten: bool, bar: Bar) -> dict[str, Any]:
    from umbel.export.lod_glb import export_glb

    report = export_glb(path, output, flatten=flatten, progress=bar)
    return {"files": 1} | dataclasses.asdict(report)


def _viewer(path: str, output: Path) -> dict[str, Any]:
    from umbel.viewer.view import export_viewer, serving_command

    if "://" in path:
        fail(f"{path}: the viewer shows files on this machine; download the asset first")
    index = export_viewer(path, output)
    files = [file for file in output.rglob("*") if file.is_file()]
    size = sum(file.stat().st_size for file in files)
    return {
        "files": len(files),
        "bytes": size,
        "index": str(index),
        "serve": serving_command(output),
    }
