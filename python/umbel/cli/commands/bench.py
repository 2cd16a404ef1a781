"""`umbel bench`: comparisons, a command each."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from umbel.cli.failure import naming_file
from umbel.cli.inputs import AllowOutside, empty_mesh
from umbel.cli.options import option
from umbel.cli.outputs import made_folder
from umbel.cli.run import Json, Threads, ends_cleanly, fail, heard, say, show

if TYPE_CHECKING:
    from umbel.bench.bvh.compare import Comparison as BvhComparison
    from umbel.bench.bvh.cuda import DeviceComparison
    from umbel.bench.bvh.scenes import Kmeans
    from umbel.bench.clusters import Comparison
    from umbel.bench.lod import Comparison as LodComparison
    from umbel.bench.stream import Comparison as Streaming
    from umbel.bench.table import Column, Row
    from umbel.bench.timing import Machine
    from umbel.geometry.mesh import Mesh

Found = TypeVar("Found", bound=Any)
Loaded = TypeVar("Loaded")

_PLANT = 200_000  # triangles, where no scene is named

app = typer.Typer(help="Comparisons: of builders, and with other libraries.", no_args_is_help=True)

Inputs = Annotated[
    list[Path] | None,
    typer.Argument(metavar="INPUT", help="Meshes; without any, procedural ones."),
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
@ends_cleanly()
def clusters(
    inputs: Inputs = None,
    output: Folder = None,
    runs: Runs = 5,
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Clusters of triangles: our presets and the Morton order beside meshoptimizer."""
    _check(inputs or [], output)

    from umbel.bench.clusters import PROCEDURAL, compare, write
    from umbel.cli.progress import Bar

    meshes = _loaders(inputs, allow_outside) if inputs else PROCEDURAL
    draws = output is not None
    with Bar() as bar:
        found = compare(meshes, runs=runs, frontier=draws, progress=bar, threads=threads)
    _finish(found, "clusters", inputs, output, as_json, write, _print_clusters)


_BVH_FLAGS = {
    "triangles": "--generated",
    "parts": "--part",
    "the resolution": "--resolution",
    "kmeans.clusters": "the first number of --kmeans",
    "kmeans.candidates": "the second number of --kmeans",
    "kmeans.iterations": "the third number of --kmeans",
}


@app.command()
@ends_cleanly(_BVH_FLAGS)
def bvh(
    # Long: typer reads the flags and their help from the signature.
    scenes: Annotated[
        list[Path] | None,
        typer.Argument(metavar="SCENES", help="Meshes; without any, a generated one."),
    ] = None,
    generated: int | None = option(None, "N", "Also a generated plant of about N triangles."),
    kmeans: str | None = option(
        None, "K,P,I", "Parameters of k-means, instead of each scene's own."
    ),
    samples: int = option(1, "N", "Paths traced a pixel.", min=1),
    share: float = option(0.05, "F", "Of each picture that is traced.", min=0.0, max=1.0),
    resolution: str = option("1024x768", "WxH", "Of the pictures, multiples of 16."),
    width: list[int] | None = option(
        None, "2|4|8", "Children a node; several times.  [default: 2, 8]"
    ),
    part: list[str] | None = option(
        None, "builders|stages|iterations", "Only this; several times.  [default: all]"
    ),
    builder: list[str] | None = option(
        None, "NAME", "Only this and the sweep; several times.  [default: all]"
    ),
    device: str = option(
        "cpu",
        "cpu|cuda",
        "Where trees are built and traced; on CUDA, of the options, only --builder, "
        "--runs, --generated and the output's count.",
    ),
    output: Folder = None,
    runs: Runs = 3,
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Builders of hierarchies: what a tree costs, how fast rays pass it, and both together, as in
    the evaluation of the k-means builder (Meister & Bittner 2016)."""
    _check(scenes or [], output)
    if device not in ("cpu", "cuda"):
        fail(f"--device is {device!r}, but must be cpu or cuda")
    widths = list(dict.fromkeys(width or (2, 8)))
    if not set(widths) <= {2, 4, 8}:
        fail("--width must be 2, 4 or 8")
    parameters = None if kmeans is None else _kmeans(kmeans)

    from umbel.bench.bvh.compare import compare, generated_scene
    from umbel.bench.bvh.methods import PARTS, Effort
    from umbel.bench.bvh.report import write
    from umbel.cli.progress import Bar

    inputs = _loaders(scenes or [], allow_outside)
    if generated is not None or not inputs:
        inputs |= generated_scene(_PLANT if generated is None else generated)
    if device == "cuda":
        _bvh_on_device(inputs, builder or [], runs, output, scenes, as_json)
        return
    effort = Effort(
        runs,
        samples,
        share,
        _resolution(resolution),
        widths,
        threads,
        part or PARTS,
        builder or (),
    )
    with Bar() as bar:
        found = compare(inputs, effort, kmeans=parameters, progress=bar)
    _finish(found, "bvh", scenes, output, as_json, write, _print_bvh)


@app.command()
@ends_cleanly()
def lod(
    inputs: Inputs = None,
    output: Folder = None,
    samples: int = option(50_000, "N", "Points on each surface.", min=100),
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Levels of detail: how far cuts of 10 %, 1 % and 0.1 % of the triangles are from the mesh,
    beside meshoptimizer's clusterlod.h. Each is built on one thread: --threads is ignored."""
    _check(inputs or [], output)

    from umbel.bench import lod as bench
    from umbel.cli.progress import Bar

    with Bar() as bar:
        found = bench.compare(
            _loaders(inputs, allow_outside) if inputs else bench.PROCEDURAL,
            samples=samples,
            progress=bar,
        )
    _finish(found, "lod", inputs, output, as_json, bench.write, _print_lod)


def _print_lod(found: LodComparison) -> None:
    from umbel.bench.lod import COLUMNS, RATIOS, report

    ratios = "Ours over clusterlod.h's, geometric means"
    _print_tables(
        found.machine,
        lambda: report(found),
        ("Levels of detail", COLUMNS, found.rows, "mesh"),
        (ratios, RATIOS, found.ratios, "share"),
    )


@app.command()
@ends_cleanly()
def stream(
    inputs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="INPUT", help="Assets or meshes; without any, a blob."),
    ] = None,
    seconds: float = option(
        20.0, "S", "Simulated seconds of the camera's path.", min=0.1, max=86_400.0
    ),
    output: Folder = None,
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Streaming under budgets of 5 to 50 percent, from a disk and over a network: how many frames
    are within a pixel, what is loaded, and what a step takes. Simulated time."""
    _check(inputs or [], output)

    from umbel.bench import stream as bench
    from umbel.bench.table import print_table
    from umbel.cli.progress import Bar

    load = partial(bench.stored, allow_outside=allow_outside)
    assets = _named(inputs, load) if inputs else {"blob": bench.blob}
    with Bar() as bar:
        found = bench.simulate(assets, seconds=seconds, progress=bar)

    def print_found(found: Streaming) -> None:
        if sys.stdout.isatty():
            print_table("Streaming", bench.COLUMNS, found.rows, group="line")
        else:
            print(bench.report(found), end="")

    _finish(found, "stream", inputs, output, as_json, bench.write, print_found)


def _kmeans(text: str) -> Kmeans:
    from umbel.accel.trees import build_bvh2
    from umbel.bench.bvh.scenes import Kmeans

    try:
        clusters, candidates, iterations = (int(part) for part in text.split(","))
    except ValueError:
        fail(f"--kmeans is {text!r}, but must be three whole numbers such as 8,5,2")
    given = Kmeans(clusters, candidates, iterations)
    build_bvh2(empty_mesh(), builder="kmeans", **given.arguments())
    return given


def _resolution(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.split("x"))
    except ValueError:
        fail(f"--resolution is {text!r}, but must be two whole numbers such as 1024x768")
    return width, height


def _bvh_on_device(
    inputs: dict[str, Callable[[], Mesh]],
    builders: list[str],
    runs: int,
    output: Path | None,
    scenes: list[Path] | None,
    as_json: bool,
) -> None:
    import tempfile

    from umbel import io
    from umbel.bench.bvh import cuda as bvh_cuda
    from umbel.bench.table import print_table

    bvh_cuda.check_program()
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{name}.ply" for name in inputs]
        for path, load in zip(paths, inputs.values(), strict=True):
            mesh = load()
            io.save(path, type(mesh)(mesh.positions, mesh.triangles))
        found = bvh_cuda.measure(paths, runs=runs, builders=builders)

    def print_found(found: DeviceComparison) -> None:
        if sys.stdout.isatty():
            print_table(f"Builders on {found.device}", bvh_cuda.COLUMNS, found.rows, group="scene")
        else:
            print(bvh_cuda.report(found), end="")

    _finish(found, "bvh", scenes, output, as_json, bvh_cuda.write, print_found)


def _print_bvh(found: BvhComparison) -> None:
    from umbel.bench.bvh import kmeans as bvh_kmeans
    from umbel.bench.bvh.columns import CHEAPEST, COLUMNS, MEANS
    from umbel.bench.bvh.report import report

    _print_tables(
        found.machine,
        lambda: report(found),
        ("Builders", COLUMNS, found.rows, "scene"),
        ("Geometric means over the scenes", MEANS, found.means, "width"),
        ("Which for how many samples", CHEAPEST, found.cheapest, "scene"),
        ("k-means by stage", bvh_kmeans.STAGES, found.stages, "scene"),
        ("SAH cost of k-means", bvh_kmeans.ITERATIONS, found.iterations, "scene"),
    )


def _why(path: Path) -> str:
    return "it is a folder" if path.is_dir() else "no such file"


def _check(inputs: list[Path], output: Path | None) -> None:
    """Refuses, before any work, what could not be read or written."""
    for path in inputs:
        if not path.is_file():
            fail(f"cannot read {path}: {_why(path)}", source=str(path))
    if output is not None:
        made_folder(output)


def _finish(
    found: Found,
    title: str,
    inputs: Sequence[Path] | None,
    output: Path | None,
    as_json: bool,
    write: Callable[[Found, Path], Any],
    print_found: Callable[[Found], None],
) -> None:
    """Writes what was found into the folder `output`, if there is one, and prints it."""
    from umbel.bench import charts

    if output is not None:
        if not charts.available():
            say(charts.WITHOUT)
        write(found, output)
    if not as_json:
        print_found(found)
        return
    result = {"input": [str(path) for path in inputs or []]}
    written = {"output": None if output is None else str(output)}
    show({**result, **written, **found.fields(), "warnings": heard}, True, title)


def _valid(path: Path, allow_outside: bool) -> Mesh:
    """The mesh in a file; what is wrong with it names the file."""
    from umbel.errors import Error
    from umbel.geometry.repair import validate
    from umbel.io import load

    mesh = load(path, allow_outside=allow_outside)
    try:
        validate(mesh)
    except Error as error:
        fail(naming_file(str(error), str(path), [str(path)]), source=str(path))
    return mesh


def _loaders(paths: list[Path], allow_outside: bool) -> dict[str, Callable[[], Mesh]]:
    """What loads each mesh, under a name of its own."""
    return _named(paths, partial(_valid, allow_outside=allow_outside))


def _named(paths: list[Path], load: Callable[[Path], Loaded]) -> dict[str, Callable[[], Loaded]]:
    """What loads each file, under a name of its own."""
    loaders: dict[str, Callable[[], Loaded]] = {}
    for path in paths:
        name, number = path.stem, 1
        while name in loaders:
            number += 1
            name = f"{path.stem}-{number}"
        loaders[name] = partial(load, path)
    return loaders


def _print_clusters(found: Comparison) -> None:
    from umbel.bench.clusters import COLUMNS, MEANS, report

    _print_tables(
        found.machine,
        lambda: report(found),
        ("Clusters", COLUMNS, found.rows, "mesh"),
        ("Geometric means over the meshes", MEANS, found.means, "method"),
    )


def _print_tables(
    machine: Machine,
    report: Callable[[], str],
    *tables: tuple[str, Sequence[Column], list[Row], str],
) -> None:
    """The tables (title, columns, rows, column to group by) on a terminal, else the report."""
    from umbel.bench.table import print_table

    if not sys.stdout.isatty():
        print(report(), end="")
        return
    print(*machine.sentences(), sep="\n")
    for title, columns, rows, group in tables:
        if rows:
            print_table(title, columns, rows, group=group)
