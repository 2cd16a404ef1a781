"""Mesh files as sources of triangles that are read in blocks, in a memory that does not grow with
them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from umbel import _umbel
from umbel.errors import Error, LoadWarning, warn_lost
from umbel.geometry.mesh import Material, Mesh
from umbel.geometry.origin import Rounding
from umbel.io import load_scene
from umbel.io.blocks import gltf, obj, ply, stl
from umbel.io.blocks.called import called, is_called
from umbel.io.blocks.layout import Layout
from umbel.io.blocks.spool import spool, spool_mesh
from umbel.io.coordinates import sidecar
from umbel.io.format_losses import WHERE, scene_losses
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
    #: what `Asset.scene` shall be
    tree: dict[str, Any] = field(default_factory=dict)
    #: By which other machines that have the files open it (`layout.again`); None: they cannot.
    recipe: dict[str, list[Any]] | None = None
    #: What float32 took of meshes that were read as a whole.
    rounding: Rounding = field(default_factory=Rounding)
    #: Of each part: the material of all its triangles, or those that its numbers are.
    material_numbers: list[int | list[int] | None] = field(default_factory=list)


def open_source(
    source: Paths | Mesh | Iterable[Any],
    work: str | os.PathLike[str],
    *,
    allow_outside: bool = False,
) -> Source:
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
    whose numbers mean other nodes in each, only one is taken. What a file says of its scene (nodes,
    cameras, lights, extras, copyright) is kept of a single file, and of that with joints; a warning
    names what is left out of others. `allow_outside` is that of `umbel.load`.
    """
    layout = Layout(Path(work), allow_outside)
    coordinates: dict[str, str] = {}
    rounding = Rounding()
    if isinstance(source, (str, os.PathLike)):
        files: list[Path] | None = [Path(source)]
    elif isinstance(source, Sequence) and all(isinstance(p, (str, os.PathLike)) for p in source):
        files = [Path(path) for path in source]
    elif is_called(source):
        return Source(called(source), vertices=getattr(source, "vertex_count", None))
    elif isinstance(source, Mesh):
        files, coordinates = None, source.coordinates
        rounding = source.rounding
        spool_mesh(layout, source, source.source or source.name or "the mesh")
        layout.trees.append((Path(source.source), source.tree))
    else:
        files = None
        try:
            blocks = iter(source)
        except TypeError:
            raise Error(
                f"a source is files, a mesh or blocks of triangles, not {source!r:.80}"
            ) from None
        spool(layout, blocks, "the blocks")
    skinned: list[Path] = []
    for file in files or []:
        said, mesh = _add(layout, file)
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
    _warn_of_zeros(layout)
    native = layout.finished()
    if native.put_in_order(layout.work / "sorted_", _LEAST_BYTES, _BLOCK):
        layout.recipe = None
    triangles = _umbel.TableSource(native)
    return Source(
        triangles,
        layout.materials,
        coordinates,
        files or [],
        layout.vertices,
        _tree_of(layout, skinned[0] if skinned else None, len(files or []) > 1),
        layout.recipe,
        rounding,
        [part.material if part.numbers is None else part.numbers for part in layout.parts],
    )


def _tree_of(layout: Layout, skinned: Path | None, are_several: bool) -> dict[str, Any]:
    """The scene of the only file, or of the one with joints, whose numbers are nodes of it. Of
    others a warning says what is lost."""
    kept: dict[str, Any] = {}
    lost: dict[str, list[Path]] = {}
    for file, tree in layout.trees:
        if not are_several or file == skinned:
            kept = {} if is_trivial(tree) else tree
            continue
        for what in (*_notes_lost(tree, file.stem), *scene_losses(tree)):
            lost.setdefault(what, []).append(file)
    if lost:
        files = list(dict.fromkeys(file for named in lost.values() for file in named))
        more = f" and {len(files) - 1} more" if len(files) > 1 else ""
        warn_lost(f"{files[0]}{more}: left out, as all becomes one mesh", list(lost), 8)
    return kept


def _notes_lost(tree: dict[str, Any], stem: str) -> Iterator[str]:
    """A mesh that its node has moved is on a node of its own, named like the file."""
    if any(set(n) - WHERE and n.get("name") != stem for n in tree.get("nodes", [])):
        yield "names, extras and extensions of nodes"
    if tree.get("asset", {}).get("copyright"):
        yield "copyright"


def _warn_of_zeros(layout: Layout) -> None:
    """Says which files have no normals or tangents where others have: making them would need a
    whole file in memory."""
    parts = [part for part in layout.parts if part.triangles or "indices" not in part.columns]
    for stream in ("normals", "tangents"):
        without = list(dict.fromkeys(p.name for p in parts if stream not in p.columns))
        if without and any(stream in part.columns for part in parts):
            more = f" and {len(without) - 1} more" if len(without) > 1 else ""
            verb = "have" if more else "has"
            sentence = f"{without[0]}{more} {verb} no {stream}, as others have: there they are zero"
            warnings.warn(sentence, LoadWarning, stacklevel=3)


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
    scene = load_scene(file, allow_outside=layout.allow_outside)
    gltf.warn_of_nodes(scene, file)
    mesh = scene.flatten()
    spool_mesh(layout, mesh, str(file))
    layout.trees.append((file, mesh.tree))
    return mesh.coordinates, mesh
