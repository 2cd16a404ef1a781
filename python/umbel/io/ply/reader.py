"""PLY, ASCII and binary of either byte order (Turk 1994), with the properties that scanners and
modellers write: normals, colours, texture coordinates at vertices or face corners, polygons,
triangle strips, material indices. Anything else in a file is left out with a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import (
    Float32Array,
    Material,
    Mesh,
    UInt32Array,
    to_uint32,
    to_unit_floats,
    unit_normals,
)
from umbel.io.colors import MOST_BRIGHT, to_linear
from umbel.io.ply import names as ply_names
from umbel.io.ply.data import Columns, ListColumn, read_tables
from umbel.io.ply.losses import LIST, warn_of_losses
from umbel.io.polygons import fans, strips
from umbel.io.scene import NO_MATERIAL, Instance, Scene, with_default

#: Types whose colours run to the largest number. Others may hold bytes; all values together tell.
WHOLE_COLORS = {"u1", "i1", "u2"}
MOST_MATERIALS = 1 << 16


def read_ply(data: bytes, where: str) -> Scene:
    """The scene in a PLY file's bytes; `where` names the file in errors."""
    columns = read_tables(data, where)
    mesh = _mesh(columns, where)
    split = _with_corner_uvs(mesh, columns.get("face", {}))
    kinds = {name: _kinds(own) for name, own in columns.items() if any(map(_rows, own.values()))}
    warn_of_losses(kinds, data, where, splits=split is not mesh)
    return Scene([split], split.materials, [Instance(0)])


def _rows(column: Any) -> int:
    return len(column.counts if isinstance(column, ListColumn) else column)


def _kinds(columns: Columns) -> dict[str, str]:
    return {n: LIST if isinstance(c, ListColumn) else c.dtype.kind for n, c in columns.items()}


def _warn(sentence: str) -> None:
    warnings.warn(sentence, LoadWarning, stacklevel=6)


# --- mesh -------------------------------------------------------------------------------------


def _stack(columns: Columns, choices: Sequence[tuple[str, ...]]) -> NDArray[Any] | None:
    """The first choice of names that are all there, as (n, k) in the columns' own type."""
    for names in choices:
        picked = [columns.get(name) for name in names]
        if all(isinstance(c, np.ndarray) for c in picked):
            return np.stack(picked, axis=1)  # type: ignore[arg-type]
    return None


def _floats(array: NDArray[Any] | None) -> Float32Array | None:
    if array is None:
        return None
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)


def _mesh(columns: dict[str, Columns], where: str) -> Mesh:
    vertex = columns.get("vertex")
    if vertex is None:
        raise Error(f"{where} has no element 'vertex'")
    points = _stack(vertex, ply_names.POSITION)
    if points is None:
        raise Error(f"{where}: element 'vertex' lacks x, y or z")
    if len(points) and not (columns.get("face") or columns.get("tristrips")):
        raise Error(f"{where} has {len(points)} vertices and no element 'face': a point cloud")
    faces = columns.get("face", {})
    normals = _floats(_stack(vertex, ply_names.NORMAL))
    triangles, parents = _triangles(columns, where)
    materials, ids = with_default(*_materials(faces, parents, where), metallic=0.0)
    mesh = Mesh(
        points,
        triangles,
        normals=None if normals is None else unit_normals(normals),
        tangents=_floats(_stack(vertex, ply_names.TANGENT)),
        uvs=_floats(_stack(vertex, ply_names.UV)),
        colors=_vertex_colors(vertex),
        material_ids=ids,
        materials=materials,
    )
    if len(points) and not len(triangles):
        _warn(f"{where} has {len(points)} vertices, and no triangles")
    mesh.fault = _fault(columns, where)
    return mesh


def _fault(columns: dict[str, Columns], where: str) -> str:
    """The first face's index that can be none, as it is in the file."""
    polygons = _index_list(columns.get("face", {}), "face", where)
    if polygons is None or polygons.values.dtype.kind == "u":
        return ""
    values = polygons.values
    wrong = np.flatnonzero(~((values >= 0) & (values == np.floor(values))))
    if not len(wrong):
        return ""
    face = int(np.searchsorted(np.cumsum(polygons.counts), wrong[0], "right"))
    vertices = len(next(c for c in columns["vertex"].values() if isinstance(c, np.ndarray)))
    return f"{where}: face {face} has vertex index {values[wrong[0]]:g}, of {vertices} there are"


def _vertex_colors(vertex: Columns) -> Float32Array | None:
    rgb = _stack(vertex, ply_names.COLOR)
    if rgb is None:
        return None
    out = np.ones((len(rgb), 4), np.float32)
    out[:, :3] = to_linear(_unit(rgb))
    alpha = _stack(vertex, ply_names.ALPHA)
    if alpha is not None:
        out[:, 3:] = _unit(alpha)
    return out


def _unit(values: NDArray[Any]) -> Float32Array:
    if values.dtype.str[1:] not in WHOLE_COLORS and len(values):
        most = np.nanmax(values, initial=0.0)
        if values.dtype.kind == "f" and most > MOST_BRIGHT:
            return values.astype(np.float32) / np.float32(255.0)
        if values.dtype.kind != "f" and most <= 255:
            return values.astype(np.float32) / np.float32(255.0)
    return to_unit_floats(values)


def _index_list(columns: Columns, element: str, where: str) -> ListColumn | None:
    for name in ply_names.INDEX_LISTS:
        column = columns.get(name)
        if isinstance(column, ListColumn):
            return column
    if columns and element == "face":
        raise Error(f"{where}: element 'face' has no list 'vertex_indices'")
    return None


def _triangles(
    columns: dict[str, Columns], where: str
) -> tuple[UInt32Array, NDArray[np.int64] | None]:
    """The triangles, and for each the face that it came from (None: its own number)."""
    polygons = _index_list(columns.get("face", {}), "face", where)
    parents: NDArray[np.int64] | None = None
    triangles = np.zeros((0, 3), np.uint32)
    if polygons is not None:
        indices = to_uint32(polygons.values)
        few = int((polygons.counts < 3).sum())
        if few:
            _warn(f"{where}: {few} faces have fewer than three corners and are left out")
        if (polygons.counts == 3).all():
            triangles = indices.reshape(-1, 3)
        else:
            corners, parents = fans(polygons.counts)
            triangles = indices[corners]
    strip = _index_list(columns.get("tristrips", {}), "tristrips", where)
    if strip is not None:
        more = strips(strip.counts, strip.values, restart=-1)
        if parents is None and len(triangles):
            parents = np.arange(len(triangles))
        if len(triangles):
            parents = np.concatenate([parents, np.full(len(more), -1)])
            triangles = np.concatenate([triangles, more])
        else:
            triangles, parents = more, np.full(len(more), -1)
    return triangles, parents


def _materials(
    faces: Columns, parents: NDArray[np.int64] | None, where: str
) -> tuple[list[Material], UInt32Array | None]:
    column = next(
        (faces[k] for k in ply_names.MATERIAL_ID if isinstance(faces.get(k), np.ndarray)), None
    )
    if column is None or column.dtype.kind == "f":
        return [], None
    of_faces = slice(None) if parents is None else parents >= 0
    column = column if parents is None else column[parents[of_faces]]
    if not len(column):
        return [], None
    low, high = int(column.min()), int(column.max())
    if low < 0 or high >= MOST_MATERIALS:
        _warn(f"{where}: material indices run from {low} to {high} and are left out")
        return [], None
    ids = np.full(len(column) if parents is None else len(parents), NO_MATERIAL, np.uint32)
    ids[of_faces] = column
    return [Material(name=f"material_{k}") for k in range(high + 1)], ids


def _with_corner_uvs(mesh: Mesh, faces: Columns) -> Mesh:
    """Splits vertices so that each corner has the texture coordinate that its face lists."""
    wedge = faces.get(ply_names.CORNER_UVS)
    polygons = next((faces[k] for k in ply_names.INDEX_LISTS if k in faces), None)
    if (
        mesh.uvs is not None
        or not isinstance(wedge, ListColumn)
        or not isinstance(polygons, ListColumn)
    ):
        return mesh
    if not len(mesh.triangles) or not (wedge.counts == 2 * polygons.counts).all():
        return mesh
    corners, _ = fans(polygons.counts)
    if len(corners) != len(mesh.triangles):  # strips beside faces have no coordinates
        return mesh
    uvs = wedge.values.reshape(-1, 2).astype(np.float32)[corners.reshape(-1)]
    old = mesh.triangles.reshape(-1)
    if (old >= len(mesh.positions)).any():
        return mesh
    key = np.empty(len(old), [("v", "u4"), ("uv", "u4", 2)])
    key["v"], key["uv"] = old, uvs.view(np.uint32)
    order = np.lexsort((key["uv"][:, 1], key["uv"][:, 0], key["v"]))
    ordered = key[order]
    new = np.concatenate([[True], ordered[1:] != ordered[:-1]])
    numbered = np.empty(len(old), np.uint32)
    numbered[order] = np.cumsum(new) - 1
    first = order[new]
    keep = old[first]

    def pick(array: Float32Array | None) -> Float32Array | None:
        return None if array is None else array[keep]

    return replace(
        mesh,
        positions=mesh.positions[keep],
        triangles=numbered.reshape(-1, 3),
        normals=pick(mesh.normals),
        tangents=pick(mesh.tangents),
        uvs=uvs[first],
        colors=pick(mesh.colors),
    )
