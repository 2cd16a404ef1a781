"""Wavefront OBJ: the arrays come from the library, which reads the text; here they become a mesh
with the materials of its libraries."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Float32Array, Material, Mesh, area_weighted_normals, unit_normals
from umbel.io.colors import to_linear
from umbel.io.files import text_of
from umbel.io.folder import Folder
from umbel.io.obj.mtl import as_name, read_mtl, shown_name, words_of
from umbel.io.scene import Instance, Scene, with_default


def read_obj(source: bytes | Path, where: str, folder: Folder | None = None) -> Scene:
    """The scene in an OBJ file or its bytes; `where` names the file in errors, material libraries
    are looked for in `folder`."""
    where = text_of(where)
    if isinstance(source, Path):
        arrays = _umbel.read_obj(source, where)
    else:
        arrays = _umbel.read_obj_bytes(source, where)
    for note in arrays["notes"]:
        _warn(_text(note))
    mesh = Mesh(
        arrays["positions"],
        arrays["triangles"],
        colors=_colors(arrays["colors"]),
        uvs=arrays["uvs"],
    )
    mesh.normals = _normals(arrays["normals"], arrays["without_normal"], mesh)
    mesh.fault = _text(arrays["fault"])
    ids = arrays["materials"]
    materials = [] if ids is None else materials_of(arrays, folder, where)
    mesh.materials, mesh.material_ids = with_default(materials, ids, metallic=0.0)
    return Scene([mesh], mesh.materials, [Instance(0)])


def _warn(sentence: str) -> None:
    warnings.warn(sentence, LoadWarning, stacklevel=5)


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")


def _colors(colors: Float32Array | None) -> Float32Array | None:
    if colors is not None:
        colors[:, :3] = to_linear(colors[:, :3])
    return colors


def _normals(given: Float32Array | None, missing: Any, mesh: Mesh) -> Float32Array | None:
    if given is None:
        return None
    normals = unit_normals(given)
    if len(missing):
        normals[missing] = area_weighted_normals(mesh.positions, mesh.triangles)[missing]
    return normals


# --- materials --------------------------------------------------------------------------------


def materials_of(arrays: dict[str, Any], folder: Folder | None, where: str) -> list[Material]:
    """The materials that `material_names` name, of the `libraries`."""
    library: dict[str, Material] = {}
    others: set[str] = set()
    for text in dict.fromkeys(arrays["libraries"]):
        for found in _libraries(as_name(text), folder, where):
            for name, material in found.items():
                if library.setdefault(name, material) != material:
                    others.add(name)
    names = [as_name(name) for name in arrays["material_names"]]
    missing = [repr(shown_name(n)) for n in names if n not in library] if library else []
    if missing:
        _warn(
            f"{where}: its libraries do not have {len(missing)} of its materials: {_some(missing)}"
        )
    doubled = [repr(shown_name(n)) for n in names if n in others]
    if doubled:
        _warn(f"{where}: several libraries have {_some(doubled)}: those of the first are taken")
    return [library.get(name) or Material(name=shown_name(name)) for name in names]


def _some(names: list[str]) -> str:
    return ", ".join([*names[:4], *(["..."] if len(names) > 4 else [])])


def _libraries(whole: str, folder: Folder | None, where: str) -> Iterator[dict[str, Material]]:
    """The materials of each library that a line `mtllib` names, in its order: its text is one name,
    or several."""
    if folder is None:
        return
    names = [whole] if _is_in(folder, whole) else words_of(whole)
    if not any(_is_in(folder, name) for name in names):
        names = [whole]  # whose error is said
    for name in names:
        try:
            path = folder.find(name)
            yield read_mtl(path.read_bytes(), folder.at(path.parent), text_of(path))
        except Error as error:
            _warn(f"{where}: no material library: {error}")
        except OSError as error:
            _warn(f"{where}: cannot read {name!r}: {error.strerror}")


def _is_in(folder: Folder, name: str) -> bool:
    try:
        folder.find(name)
    except Error:
        return False
    return True
