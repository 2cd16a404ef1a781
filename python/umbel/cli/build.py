"""`umbel build`: a mesh becomes a continuous-LOD asset."""

from __future__ import annotations

import enum
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from .run import Json, Threads, check_output, ends_cleanly, fail, say, show


class Attributes(str, enum.Enum):
    auto = "auto"
    none = "none"


def _group_size(text: str) -> tuple[int, int]:
    low, _, high = text.partition(":")
    try:
        return int(low), int(high or low)
    except ValueError:
        fail(f"--group-size must be two numbers such as 24:32, not {text!r}")


class Instances(str, enum.Enum):
    auto = "auto"
    on = "on"
    off = "off"


class SeamRule(str, enum.Enum):
    protect = "protect"
    allow = "allow"
    ignore = "ignore"


@ends_cleanly
def command(
    source: Annotated[
        Path, typer.Argument(metavar="INPUT", help="Mesh: .glb .gltf .obj .ply .stl.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="OUT.umbel", help="The asset to write.")
    ],
    max_triangles: Annotated[
        int, typer.Option(metavar="N", help="Most triangles a cluster (4 to 256).")
    ] = 128,
    max_vertices: Annotated[
        int, typer.Option(metavar="N", help="Most vertices a cluster (6 to 256).")
    ] = 128,
    group_size: Annotated[
        str, typer.Option(metavar="MIN:MAX", help="Clusters that are simplified together.")
    ] = "24:32",
    attributes: Annotated[
        Attributes,
        typer.Option(help="Keep normals, UVs, colours, joints and the like, or drop them."),
    ] = Attributes.auto,
    seams: Annotated[
        SeamRule,
        typer.Option(help="Lines where UVs or colours jump: keep, count as error, or ignore."),
    ] = SeamRule.allow,
    creases: Annotated[
        SeamRule, typer.Option(help="The same of lines where only normals do.")
    ] = SeamRule.allow,
    instances: Annotated[
        Instances,
        typer.Option(
            help="Of a scene: keep its meshes and the places where they stand apart, or make one "
            "mesh of all that is drawn; auto: apart if that is more than twice what is stored."
        ),
    ] = Instances.auto,
    mix_materials: Annotated[
        bool,
        typer.Option("--mix-materials", help="Clusters may mix materials, kept by triangle."),
    ] = False,
    precision: Annotated[
        str | None,
        typer.Option(
            metavar="MM|BITS",
            help="Snap positions to a power-of-two grid no coarser than so many millimetres "
            "(0.1mm or 0.1, where the mesh's unit is the metre), or of so many steps over the "
            "longest side (16bits). Without it, nothing is lost.",
        ),
    ] = None,
    drop_invalid: Annotated[
        bool,
        typer.Option(
            "--drop-invalid", help="Leave out triangles with NaN, infinite or missing vertices."
        ),
    ] = False,
    measured_error: Annotated[
        bool,
        typer.Option(
            "--measured-error",
            help="Measure errors as distances to the mesh, in both directions; twice as slow.",
        ),
    ] = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Build a continuous-LOD asset from a mesh or a scene."""
    check_output(output, ".umbel")
    sizes = _group_size(group_size)
    began = time.perf_counter()

    from ..io import load_scene
    from ..scene_lod import arranged, build_scene
    from .progress import Bar

    scene = arranged(load_scene(source), instances.value)
    read_seconds = time.perf_counter() - began
    with Bar() as bar:
        build_began = time.perf_counter()
        lod = build_scene(
            scene,
            instances="on",
            max_triangles=max_triangles,
            max_vertices=max_vertices,
            group_size=sizes,
            attributes=attributes.value,
            seams=seams.value,
            creases=creases.value,
            mix_materials=mix_materials,
            drop_invalid=drop_invalid,
            measured_error=measured_error,
            precision=precision,
            progress=bar,
            threads=threads,
        )
        seconds = time.perf_counter() - build_began
        lod.source["file"] = source.name
        if drop_invalid:
            say(f"{lod.report['dropped_triangles']:,} invalid triangles left out")
        write_began = time.perf_counter()
        file_bytes = lod.save(output, progress=bar, threads=threads)
        write_seconds = time.perf_counter() - write_began
    result = _result(lod, output, file_bytes, max_triangles)
    triangles = result["stored_triangles"]
    result |= {
        "seconds": seconds,
        "read_seconds": read_seconds,
        "write_seconds": write_seconds,
        "triangles_per_second": triangles / seconds if seconds > 0 else 0.0,
    }
    show(result, as_json, str(output))


def _result(lod: Any, output: Path, file_bytes: int, max_triangles: int) -> dict[str, Any]:
    from .measure import peak_rss_bytes, sha256_of, table_counts

    report = {key: value for key, value in lod.report.items() if key != "seconds"}
    triangles = report["input_triangles"]
    counts = table_counts([one.tables for one in lod.lods], max_triangles)
    return {
        "stored_triangles": triangles,
        **report,
        **counts,
        "meshes": len(lod.lods),
        "instances": max(len(lod.instances), 1),
        "file_bytes": file_bytes,
        "bytes_per_input_triangle": file_bytes / triangles if triangles else 0.0,
        "peak_rss_bytes": peak_rss_bytes(),
        "sha256": sha256_of(output),
    }
