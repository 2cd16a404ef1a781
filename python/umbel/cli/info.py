"""`umbel info`: what is in an asset or a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .run import Json, Threads, ends_cleanly, is_asset, show


@ends_cleanly
def command(
    path: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Asset (.umbel) or mesh (.glb .gltf .obj .ply .stl)."),
    ],
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Say what is in an asset or a mesh."""
    result = _asset_info(path) if is_asset(path) else _mesh_info(path, threads)
    show(result, as_json, str(path))


def _asset_info(path: Path) -> dict[str, Any]:
    from ..asset import Asset
    from .measure import sha256_of, table_counts

    asset = Asset(path)
    info = asset.info
    metadata = info["metadata"]
    stored = metadata.get("report", {})
    triangles = info["source_triangles"]
    names = ("normals", "tangents", "uvs", "colors")
    return {
        "kind": "asset",
        "format_version": info["format_version"],
        **stored,
        "input_triangles": triangles,
        "input_vertices": info["source_vertices"],
        **table_counts(asset.tables, info["max_triangles"]),
        "pages": info["pages"],
        "materials": _material_count(asset),
        "meshes": len(asset.meshes),
        "instances": len(asset.instances) or len(asset.meshes),
        "bounds": info["bounds"],
        "attributes": [name for name in names if info[name]],
        "max_triangles": info["max_triangles"],
        "max_vertices": info["max_vertices"],
        "file_bytes": info["file_bytes"],
        "bytes_per_input_triangle": info["file_bytes"] / triangles if triangles else 0.0,
        "sha256": sha256_of(path),
        "generator": metadata.get("generator"),
        "source": metadata.get("source", {}),
        "config": metadata.get("config", {}),
    }


def _material_count(asset: Any) -> int:
    named = len(asset.materials)
    highest = int(asset.tables.clusters["material"].max(initial=0))
    return max(named, highest + 1 if highest else 0)


def _mesh_info(path: Path, threads: int) -> dict[str, Any]:
    from .. import _umbel
    from ..arrays import native
    from ..errors import Error
    from ..io import load_scene
    from ..repair import validate

    scene = load_scene(path)
    mesh = scene.flatten()
    problem = None
    try:
        validate(mesh, threads=threads)
    except Error as error:
        problem = str(error)
    names = ("normals", "tangents", "uvs", "colors")
    return {
        "kind": "mesh",
        "format_version": None,
        "input_triangles": len(mesh.triangles),
        "input_vertices": len(mesh.positions),
        "pages": 0,
        "materials": len(mesh.materials),
        "meshes": len(scene.meshes),
        "instances": len(scene.instances),
        "bounds": None if problem else _umbel.bounds(native(mesh)),
        "attributes": [name for name in names if getattr(mesh, name) is not None],
        "valid": problem is None,
        "problem": problem,
        "file_bytes": path.stat().st_size,
    }
