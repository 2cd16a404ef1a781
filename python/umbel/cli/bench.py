"""`umbel bench`: comparisons with other libraries, a command each."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .run import Json, Threads, ends_cleanly, fail, say, show

if TYPE_CHECKING:
    from ..bench.clusters import Comparison
    from ..mesh import Mesh

app = typer.Typer(help="Comparisons with other libraries.", no_args_is_help=True)

Inputs = Annotated[
    list[Path] | None,
    typer.Argument(metavar="[INPUT]...", help="Meshes; without any, procedural ones."),
]
Folder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where tables and charts go; is made."),
]
Runs = Annotated[int, typer.Option(min=1, metavar="N", help="Medians of so many runs.")]


@app.callback()
def _bench() -> None:
    pass


@app.command()
@ends_cleanly
def clusters(
    inputs: Inputs = None,
    output: Folder = None,
    runs: Runs = 5,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Clusters of triangles: our presets and the Morton order beside meshoptimizer."""
    _check(inputs or [], output)

    from ..bench import charts
    from ..bench.clusters import PROCEDURAL, compare, write
    from .progress import Bar

    meshes = _loaders(inputs) if inputs else PROCEDURAL
    draws = output is not None
    with Bar() as bar:
        found = compare(meshes, runs=runs, frontier=draws, progress=bar, threads=threads)
    if output is not None:
        if not charts.available():
            say(charts.WITHOUT)
        write(found, output)
    if as_json:
        show(found.fields(), as_json, "clusters")
    else:
        _print(found)


def _check(inputs: list[Path], output: Path | None) -> None:
    """Refuses, before any work, what could not be read or written."""
    for path in inputs:
        if not path.is_file():
            fail(f"cannot read {path}: {'it is a folder' if path.is_dir() else 'no such file'}")
    if output is not None:
        with contextlib.suppress(FileExistsError):
            output.mkdir(parents=True)
        if not output.is_dir():
            fail(f"{output} is a file, not a folder")


def _loaders(paths: list[Path]) -> dict[str, Callable[[], Mesh]]:
    """What loads each mesh, under a name of its own."""
    from ..io import load

    loaders: dict[str, Callable[[], Mesh]] = {}
    for path in paths:
        name, number = path.stem, 1
        while name in loaders:
            number += 1
            name = f"{path.stem}-{number}"
        loaders[name] = partial(load, path)
    return loaders


def _print(found: Comparison) -> None:
    from ..bench.clusters import COLUMNS, MEANS, report
    from ..bench.table import print_table

    if not sys.stdout.isatty():
        print(report(found), end="")
        return
    print(*found.machine.sentences(), sep="\n")
    print_table("Clusters", COLUMNS, found.rows, group="mesh")
    print_table("Geometric means over the meshes", MEANS, found.means, group="method")
