"""Mesh files as sources of triangles that are read in blocks, in a memory that does not grow with
them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Material, Mesh
from umbel.geometry.origin import Rounding
from umbel.io import load_scene
from umbel.io.blocks import gltf, obj, ply, stl
from umbel.io.blocks.called import called, is_called
from umbel.io.blocks.layout import Layout
from umbel.io.blocks.spool import spool, spool_mesh
from umbel.io.coordinates import sidecar
from umbel.io.gltf.tree import is_trivial

__all__ = ["Source", "open_source"]

#: Vertices of fewer bytes are read again and again where triangles jump about among them.
_LEAST_BYTES = 256 << 20
#: Triangles that are mostly read at once.
_BLOCK = 1 << 18

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


@dataclass
class Source:
    """Triangles to read in blocks, and what belongs to all of them."""

    triangles: Any  #: `_umbel.TriangleSource`
    materials: list[Material] = field(default_factory=list)
    coordinates: dict[str, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)  #: that are read; none for an iterator
    vertices: int | None = None  #: of all files, where they are known without reading those
    #: what `Asset.scene` shall be of a single mesh that was read as a whole
    tree: dict[str, Any] = field(default_factory=dict)
    #: By which other machines that have the files open it (`layout.again`); None: they cannot.
    recipe: dict[str, list[Any]] | None = None
    #: What float32 took of meshes that were read as a whole.
    rounding: Rounding = field(default_factory=Rounding)


def open_source(source: Paths | Mesh | Iterable[Any], work: str | os.PathLike[str]) -> Source:
    """One file, several, a mesh, or an iterable of blocks (meshes; anything with `positions` and
    `triangles`, and perhaps `normals`, `tangents`, `uvs`, `colors` and `materials`, a number a
    triangle; or pairs of the first two), as one mesh: parts that have vertices at equal positions
    join there. An object that gives any range of its triangles is read range by range, several
    times, and takes no disk: it has `triangle_count`, perhaps `vertex_count`, and
    `block(begin, end)`, which gives such a block, the same each time (`umbel.testing.giant`).

    Binary PLY and STL and uncompressed glTF are read where they are. All else is written once to
    tables in the folder `work`, which must stay: OBJ and iterables in little memory; text of the
    other formats, packed, compressed and skinned files as a whole, so those must fit into memory;
    large meshes whose triangles jump about among their vertices. Of several files with joints,
    whose numbers mean other nodes in each, only one is taken.
    """
    layout = Layout(Path(work))
    whole: Mesh | None = None
    coordinates: dict[str, str] = {}
    rounding = Rounding()
    if isinstance(source, (str, os.PathLike)):
        files: list[Path] | None = [Path(source)]
    elif isinstance(source, Sequence) and all(isinstance(p, (str, os.PathLike)) for p in source):
        files = [Path(path) for path in source]
    elif is_called(source):
        return Source(called(source), vertices=getattr(source, "vertex_count", None))
    elif isinstance(source, Mesh):
        files, coordinates, whole = None, source.coordinates, source
        rounding = source.rounding
        spool_mesh(layout, source, source.source or source.name or "the mesh")
    else:
        files = None
        spool(layout, source, "the blocks")
    skinned: list[Path] = []
    for file in files or []:
        said, mesh = _add(layout, file)
        whole = mesh if len(files or []) == 1 else None
        if mesh is not None:
            moved = max(rounding.largest_move, mesh.rounding.largest_move)
            rounding = Rounding(moved, rounding.degenerate + mesh.rounding.degenerate)
        skinned += [file] if mesh is not None and mesh.joints is not None else []
        if len(skinned) > 1:
            raise Error(
                f"{skinned[1]} has joints, and so has {skinned[0]}: each can be built by itself"
            )
        if said and coordinates and said != coordinates:
            warnings.warn(
                f"{file}: its coordinates are {_told(said)}, not {_told(coordinates)} as before; "
                "they are read as the same",
                LoadWarning,
                stacklevel=2,
            )
        coordinates = coordinates or said
    if files is not None and not files:
        raise Error("there are no files to read")
    native = layout.finished()
    if native.put_in_order(layout.work / "sorted_", _LEAST_BYTES, _BLOCK):
        layout.recipe = None
    triangles = _umbel.TableSource(native)
    tree = {} if whole is None or is_trivial(whole.tree) else whole.tree
    return Source(
        triangles,
        layout.materials,
        coordinates,
        files or [],
        layout.vertices,
        tree,
        layout.recipe,
        rounding,
    )


def _told(coordinates: dict[str, str]) -> str:
    return ", ".join(f"{key} {value[:40]}" for key, value in coordinates.items())


def _add(layout: Layout, file: Path) -> tuple[dict[str, str], Mesh | None]:
    """Adds a file; gives what it says of its coordinates, and its mesh where it was read as a
    whole."""
    kinds = {
        ".ply": ply.lay_out,
        ".stl": stl.lay_out,
        ".obj": obj.lay_out,
        ".glb": gltf.lay_out,
        ".gltf": gltf.lay_out,
    }
    lay_out = kinds.get(file.suffix.lower())
    if lay_out is not None and lay_out(layout, file):
        return {**(gltf.COORDINATES if lay_out is gltf.lay_out else {}), **sidecar(file)}, None
    scene = load_scene(file)
    gltf.warn_of_nodes(scene, file)
    mesh = scene.flatten()
    spool_mesh(layout, mesh, str(file))
    return mesh.coordinates, mesh
