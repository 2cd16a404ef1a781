"""`umbel info`: what is in an asset or a mesh."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING, Annotated, Any

import typer

from umbel.cli.failure import naming_file, with_flags
from umbel.cli.inputs import AllowOutside
from umbel.cli.run import Json, Threads, ends_cleanly, heard, is_asset, show

if TYPE_CHECKING:
    from umbel.geometry.mesh import Mesh


@ends_cleanly()
def command(
    path: Annotated[
        str,
        typer.Argument(metavar="FILE", help="Asset (.umbel) or mesh (.glb .gltf .obj .ply .stl)."),
    ],
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Say what is in an asset or a mesh."""
    result = _asset_info(path) if is_asset(path) else _mesh_info(path, allow_outside, threads)
    show({**result, "warnings": heard}, as_json, path)


def _asset_info(path: str) -> dict[str, Any]:
    from umbel.cli.measure import sha256_of, total_counts
    from umbel.io.addresses import is_address
    from umbel.lod.asset import Asset
    from umbel.lod.instances import instances_of_meshes

    asset = Asset(path)
    info = asset.info
    metadata = info["metadata"]
    stored = metadata.get("report", {})
    counts = [
        mesh | found for mesh, found in zip(asset.meshes, asset._native.summaries(), strict=True)
    ]
    drawn = list(zip(instances_of_meshes(asset).tolist(), asset.meshes, strict=True))
    triangles = sum(count * mesh["source_triangles"] for count, mesh in drawn)
    names = ("normals", "tangents", "uvs", "colors")
    return {
        "input": path,
        "kind": "asset",
        "format_version": info["format_version"],
        **stored,
        "input_triangles": triangles,
        "input_vertices": sum(count * mesh["source_vertices"] for count, mesh in drawn),
        "stored_triangles": info["source_triangles"],
        **total_counts(counts, info["max_triangles"]),
        "pages": info["pages"],
        "materials": _material_count(asset, counts),
        "meshes": len(asset.meshes),
        "instances": asset.instance_count,
        "bounds": _bounds(asset),
        "origin": list(info["origin"]),
        "coordinates": asset.coordinates,
        "attributes": [name for name in names if any(mesh[name] for mesh in asset.meshes)],
        "max_triangles": info["max_triangles"],
        "max_vertices": info["max_vertices"],
        "file_bytes": info["file_bytes"],
        "bytes_per_input_triangle": info["file_bytes"] / triangles if triangles else 0.0,
        "sha256": None if is_address(path) else sha256_of(path),
        "generator": metadata.get("generator"),
        "source": metadata.get("source", {}),
        "config": metadata.get("config", {}),
    }


def _bounds(asset: Any) -> Any:
    """Of the boxes of all instances."""
    from umbel.lod.instances import asset_boxes

    box = asset_boxes(asset).bounds if asset.instances else None
    return asset.info["bounds"] if box is None else box.tolist()


def _material_count(asset: Any, counts: list[dict[str, Any]]) -> int:
    named = len(asset.materials)
    highest = max((mesh["max_material"] for mesh in counts), default=0)
    return max(named, highest + 1 if highest else 0)


def _problem(mesh: Mesh, threads: int) -> str | None:
    """Why `umbel build` refuses a mesh."""
    import numpy as np

    from umbel.errors import Error
    from umbel.geometry.precision_loss import refuse_collapse
    from umbel.geometry.repair import validate
    from umbel.lod.build import build_lod

    try:
        validate(mesh, threads=threads)
        refuse_collapse(mesh, None)
        if mesh.bounds is not None:  # one triangle tells whether its corners are too far away
            corners = (mesh.bounds - mesh.origin).astype(np.float32)
            build_lod((corners, np.array([[0, 1, 0]], np.uint32)))
    except Error as error:
        sentence = with_flags(str(error), {"with force": "with --force"}, [mesh.source])
        return naming_file(sentence, mesh.source, [mesh.source])
    return None


def _file_bytes(path: str) -> int | None:
    """None of a pipe."""
    from umbel.io.addresses import is_address
    from umbel.lod.remote import remote

    if is_address(path):
        return int(remote(path)[0])
    return os.path.getsize(path) if os.path.isfile(path) else None


def _mesh_info(path: str, allow_outside: bool, threads: int) -> dict[str, Any]:
    from umbel.io import load_scene
    from umbel.lod.arrange import arrange, is_single

    scene = load_scene(path, allow_outside=allow_outside)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what a build would say
        built = arrange(scene)
    mesh = built.meshes[0] if is_single(built) else scene.flatten()
    problems = (_problem(one, threads) for one in built.meshes)
    problem = next((found for found in problems if found is not None), None)
    names = ("normals", "tangents", "uvs", "colors")
    return {
        "input": path,
        "kind": "mesh",
        "format_version": None,
        "input_triangles": len(mesh.triangles),
        "input_vertices": len(mesh.positions),
        "pages": 0,
        "materials": len(mesh.materials),
        "meshes": len(scene.meshes),
        "instances": len(scene.instances),
        "bounds": None if problem or mesh.bounds is None else mesh.bounds.tolist(),
        "origin": mesh.origin.tolist(),
        "coordinates": mesh.coordinates,
        "attributes": [name for name in names if getattr(mesh, name) is not None],
        "valid": problem is None,
        "problem": problem,
        "file_bytes": _file_bytes(path),
    }
