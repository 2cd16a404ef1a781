"""`umbel build`: a mesh becomes a continuous-LOD asset."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from umbel.cli.inputs import AllowOutside
from umbel.cli.options import Attributes, Instances, SeamRule, option, switch
from umbel.cli.run import Json, Threads, ends_cleanly, fail, heard, show, warn_no_effect

if TYPE_CHECKING:
    from umbel.cli.building.build_file import Limits, Options

_FLAGS = {
    "with force": "with --force",
    "a finer precision": "a finer --precision",
    "drop_invalid": "--drop-invalid",
    "allow_outside": "--allow-outside",
    "max_items": "--max-triangles",
    "group size": "--group-size",
    "min_group": "the first number of --group-size",
    "max_group": "the second number of --group-size",
    "with resume": "with --resume",
    "unit_triangles": "--unit-triangles",
    "memory of": "--memory",
    "normal bits": "--normal-bits",
    "tangent bits": "--tangent-bits",
    "color bits": "--color-bits",
    "uv bits": "--uv-bits",
}


def _group_size(text: str) -> tuple[int, int]:
    low, _, high = text.partition(":")
    try:
        return int(low), int(high or low)
    except ValueError:
        fail(f"--group-size must be two numbers such as 24:32, not {text!r}")


def _bits(of: str) -> Any:
    return option(
        None,
        "N",
        f"Bits of each stored number of {of} (2 to 16; 0: floats, unchanged). Without it, what "
        "goes with --precision; all without that.",
    )


def _cost(value: float, what: str) -> Any:
    return option(value, "C", f"What {what}, 0 to 1.")


@ends_cleanly(_FLAGS)
def command(
    # Long: typer reads the flags and their help from the signature.
    inputs: Annotated[
        list[str],
        typer.Argument(
            metavar="INPUT",
            help="Meshes (.glb .gltf .obj .ply .stl), folders of them, quoted patterns such as "
            "'models/**/*.glb', or addresses (https://, s3://).",
        ),
    ],
    output: Annotated[
        str,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT.umbel|DIR",
            help="The asset to write; of several inputs the folder for their assets, which lie in "
            "it as the meshes do below their common folder.",
        ),
    ],
    max_triangles: int = option(128, "N", "Most triangles a cluster (4 to 256)."),
    max_vertices: int = option(128, "N", "Most vertices a cluster (6 to 256)."),
    group_size: str = option("24:32", "MIN:MAX", "Clusters that are simplified together."),
    attributes: Attributes = option(
        Attributes.auto, None, "Keep normals, UVs, colours, joints and the like, or drop them."
    ),
    seams: SeamRule = option(
        SeamRule.allow, None, "Lines where UVs or colours jump: keep, count as error, or ignore."
    ),
    creases: SeamRule = option(SeamRule.allow, None, "The same of lines where only normals do."),
    instances: Instances = option(
        Instances.auto,
        None,
        "Of a scene: keep its meshes and their instances apart, or make one "
        "mesh of all that is drawn; auto: apart if that is more than twice what is stored.",
    ),
    mix_materials: bool = switch(
        "--mix-materials", "Clusters may mix materials, kept by triangle."
    ),
    precision: str | None = option(
        None,
        "0.1mm|16bits",
        "Snap positions to a power-of-two grid no coarser than so many millimetres "
        "(where the mesh's unit is the metre), or of so many steps over the longest side. "
        "Without it, nothing is lost.",
    ),
    normal_bits: int | None = _bits("normals"),
    tangent_bits: int | None = _bits("tangents"),
    color_bits: int | None = _bits("colours"),
    uv_bits: int | None = option(
        None, "N", "Texture coordinates are multiples of 2^-N (1 to 24; 0: unchanged)."
    ),
    min_triangles: int = option(
        0, "N", "Least triangles a cluster should have; 0: a quarter of the most."
    ),
    underfill: float = _cost(0.3, "clusters of few triangles cost"),
    vertex_underfill: float = _cost(0.5, "clusters of few vertices cost"),
    overlap: float = _cost(0.0, "overlap of clusters' boxes costs"),
    group_underfill: float = _cost(0.5, "groups of few clusters cost"),
    group_overlap: float = _cost(0.0, "overlap of groups' boxes costs"),
    lock_borders: bool = switch(
        "--lock-borders",
        "Keep open edges as they are in every cut, so that parts built apart join.",
    ),
    drop_invalid: bool = switch(
        "--drop-invalid", "Leave out triangles with NaN, infinite or missing vertices."
    ),
    force: bool = switch(
        "--force",
        "Build even where --precision, or rounding to 32-bit floats, takes the area of "
        "more than 1 % of the triangles.",
    ),
    measured_error: bool = switch(
        "--measured-error",
        "Measure errors as distances to the mesh, in both directions; 1.3 to 4.5 times as slow.",
    ),
    jobs: int = option(1, "N", "Of several inputs: build N files side by side."),
    skip_unchanged: bool = switch(
        "--skip-unchanged",
        "Leave an asset that is there as it is, if it was made of the same file (and "
        "those that it refers to), with the same flags, by the same version.",
    ),
    keep_going: bool = switch(
        "--keep-going", "Of several inputs that become an asset each: go on after one that fails."
    ),
    memory: str | None = option(
        None,
        "SIZE",
        "Build in about so much memory, as in 2GB: a mesh that takes more is built in "
        "parts, on disk. Without it, three quarters of what is free.",
    ),
    work: str | None = option(
        None,
        "DIR",
        "Where a mesh that does not fit into memory is built, beside the output unless "
        "it is given. It stays where the build is stopped.",
    ),
    resume: bool = switch("--resume", "Go on with a build that was stopped, in the same folder."),
    unit_triangles: int | None = option(
        None,
        "N",
        "Build in parts of at most N triangles (4194304 where memory asks for parts). "
        "Smaller ones need less memory; the result is another.",
    ),
    ray: str | None = option(
        None,
        "auto|local|ADDRESS",
        "Build in parts on a Ray cluster: all inputs as one mesh. Inputs, output and --work may "
        "then be addresses, such as s3://.",
    ),
    dask: str | None = option(None, "ADDRESS", "The same by a Dask scheduler."),
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Build continuous-LOD assets from meshes or scenes.

    With --json and several inputs, one object a file is printed, each on a line."""
    from umbel.cli.building.build_file import Limits, Options
    from umbel.cli.building.jobs import is_many
    from umbel.io.addresses import is_address

    options = Options(
        max_triangles=max_triangles,
        max_vertices=max_vertices,
        group_size=_group_size(group_size),
        attributes=attributes.value,
        seams=seams.value,
        creases=creases.value,
        instances=instances.value,
        mix_materials=mix_materials,
        precision=precision,
        normal_bits=normal_bits,
        tangent_bits=tangent_bits,
        color_bits=color_bits,
        uv_bits=uv_bits,
        min_triangles=min_triangles,
        underfill_cost=underfill,
        vertex_underfill_cost=vertex_underfill,
        overlap_cost=overlap,
        group_underfill_cost=group_underfill,
        group_overlap_cost=group_overlap,
        lock_borders=lock_borders,
        drop_invalid=drop_invalid,
        measured_error=measured_error,
        force=force,
        allow_outside=allow_outside,
        unit_triangles=unit_triangles,
    )
    options.check()
    if jobs < 1:
        fail(f"--jobs must be at least 1, not {jobs}")
    limits = Limits(memory, work, resume)
    is_limited = limits != Limits() or unit_triangles is not None
    is_elsewhere = ray is not None or dask is not None
    several = is_many(inputs, output)
    names_asset = output.lower().endswith(".umbel") and not os.path.isdir(output)
    if keep_going and names_asset and several and (is_limited or is_elsewhere):
        fail("--keep-going is for several assets: one mesh needs all of its inputs")
    is_one_asset = is_elsewhere or not several or (is_limited and names_asset)
    _warn_of_flags(options, jobs, keep_going, is_one_asset)
    if is_elsewhere:
        _build_elsewhere(
            inputs, output, options, limits, (ray, dask), skip_unchanged, as_json, threads
        )
        return
    for flag, name in (("-o", output), ("--work", work or "")):
        if is_address(name):
            fail(f"{flag} {name}: only --ray and --dask write to addresses; name a path")
    if is_one_asset:
        from umbel.cli.building.jobs import files_of

        files = files_of(inputs) if several else inputs
        _build_one(files, output, options, limits, skip_unchanged, as_json, threads)
        return
    if is_limited:
        fail(
            "--memory, --work, --resume and --unit-triangles are for one asset: name it, as in "
            "-o OUT.umbel, and all inputs become one mesh"
        )
    from umbel.cli.building.build_many import build_many

    build_many(
        inputs,
        output,
        options,
        jobs=jobs,
        skip_unchanged=skip_unchanged,
        keep_going=keep_going,
        as_json=as_json,
        threads=threads,
        flags=_FLAGS,
    )


def _warn_of_flags(options: Options, jobs: int, keep_going: bool, is_one_asset: bool) -> None:
    """Warns of flags that have no effect on this build."""
    for flag, is_given in (("--jobs", jobs > 1), ("--keep-going", keep_going)):
        if is_given and is_one_asset:
            warn_no_effect(flag, "it is for several assets")
    if options.attributes == "auto":
        return
    usual = type(options)()
    for name in ("seams", "creases", "normal_bits", "tangent_bits", "color_bits", "uv_bits"):
        if getattr(options, name) != getattr(usual, name):
            flag = f"--{name.replace('_', '-')}"
            warn_no_effect(flag, "it is for attributes, and --attributes none removes them")


def _build_elsewhere(
    inputs: list[str],
    output: str,
    options: Options,
    limits: Limits,
    engines: tuple[str | None, str | None],
    skip_unchanged: bool,
    as_json: bool,
    threads: int,
) -> None:
    """One asset of all inputs, by the workers of a cluster."""
    from umbel.cli.building.build_file import build_units
    from umbel.cli.outputs import check_output
    from umbel.cli.progress import Bar
    from umbel.io.addresses import is_address
    from umbel.scale import Dask, Ray

    ray, dask = engines
    if ray is not None and dask is not None:
        fail("--ray and --dask: give one of them")
    flag = options.not_in_units()
    if flag is not None:
        fail(f"{flag} is not possible unit by unit")
    if not output.lower().endswith(".umbel"):
        fail(f"{output}: the output of --ray and --dask is one asset, and must end in .umbel")
    if not is_address(output):
        check_output(Path(output), ".umbel", inputs=[i for i in inputs if not is_address(i)])
    if skip_unchanged and any(map(is_address, (*inputs, output))):
        warn_no_effect("--skip-unchanged", "what is at addresses is always built again")
    executor = Ray(ray) if ray is not None else Dask(str(dask))
    with Bar(time_left=True) as bar:
        result = build_units(
            inputs,
            output,
            options,
            limits,
            executor=executor,
            skip_unchanged=skip_unchanged,
            progress=bar,
            threads=threads,
        )
    _show(result, inputs, output, as_json)


def _build_one(
    sources: list[str],
    output: str,
    options: Options,
    limits: Limits,
    skip_unchanged: bool,
    as_json: bool,
    threads: int,
) -> None:
    from umbel.cli.building.build_file import build_file, build_units, in_units
    from umbel.cli.outputs import check_output
    from umbel.cli.progress import Bar

    check_output(Path(output), ".umbel", inputs=sources)
    units = in_units(sources, Path(output), options, limits)
    with Bar(time_left=units) as bar:
        common: dict[str, Any] = {
            "skip_unchanged": skip_unchanged,
            "progress": bar,
            "threads": threads,
        }
        if units:
            result = build_units(sources, output, options, limits, **common)
        else:
            result = build_file(sources[0], Path(output), options, **common)
    _show(result, sources, output, as_json)


def _show(result: dict[str, Any], sources: list[str], output: str, as_json: bool) -> None:
    from umbel.cli.summary import build_rows, print_rows

    if as_json:
        show({**result, "warnings": heard}, as_json, output)
    elif result["status"] == "unchanged":
        print(f"{output} is up to date")
    else:
        name = os.path.basename(sources[0]) if len(sources) == 1 else f"{len(sources)} inputs"
        print_rows(f"{name} as a continuous-LOD asset, {output}", build_rows(result))
