"""Blocks of triangles written to tables, once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.geometry.arrays import check_joints
from umbel.geometry.mesh import Material, Mesh, to_uint32
from umbel.io.blocks.layout import Column, Extra, Layout
from umbel.io.blocks.shared_materials import SharedMaterials
from umbel.io.files import replacing

_WIDTHS = {"positions": 3, "normals": 3, "tangents": 4, "uvs": 2, "colors": 4}
#: What a mesh has several sets of: kind, as the library numbers it, and values a set.
_SETS = {"uvs": (4, 2), "joints": (16, 4), "weights": (32, 4)}
#: A table's rows are numbered by 32 bits.
_MOST_VERTICES = 2**32 - 2
_BLOCK = 1 << 20


def spool(layout: Layout, blocks: Iterable[Any], name: str) -> None:
    """Adds what an iterable gives, block by block. Blocks have the same streams."""
    streams: list[str] | None = None
    rows = _checked(blocks, name, layout.shared)
    first = next(rows, None)
    while first is not None:
        streams = streams or list(first[0])
        try:
            first = _spool_part(layout, first, rows, name, streams)
        except _NoBlock as failed:
            assert failed.__cause__
            raise failed.__cause__ from None


def spool_mesh(layout: Layout, mesh: Mesh, name: str) -> None:
    """Adds a mesh that is in memory."""
    numbers = None if mesh.material_ids is None else layout.shared.add(mesh.materials)
    vertices = {
        key: getattr(mesh, key)
        for key in _WIDTHS
        if key != "positions" and getattr(mesh, key) is not None
    }
    arrays = {"positions": mesh.world_positions, **vertices, **_sets(mesh)}
    _spool_part(
        layout, (arrays, mesh.triangles, mesh.material_ids), iter(()), name, list(arrays), numbers
    )


def _numbered(ids: NDArray[np.uint32], numbers: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """The materials of all meshes that a mesh's own are; what it does not have stays."""
    out = ids.copy()
    has = ids < len(numbers)
    out[has] = numbers[ids[has]]
    return out


class _NoBlock(Exception):
    """An OSError of whoever gives the blocks: no file that is written is at fault."""


Rows = tuple[dict[str, NDArray[Any]], NDArray[np.uint32], NDArray[np.uint32] | None]


def _sets(mesh: Mesh) -> dict[str, NDArray[Any]]:
    """Further texture coordinates, joints and weights, by names such as "uvs 1"."""
    found: dict[str, NDArray[Any]] = {f"uvs {k + 1}": uvs for k, uvs in enumerate(mesh.uv_sets)}
    if mesh.joints is None or mesh.weights is None:
        return found
    check_joints(mesh.joints)
    for key, values in (("joints", mesh.joints), ("weights", mesh.weights)):
        sets = np.split(values, values.shape[1] // 4, axis=1)
        found |= {f"{key} {k}": one for k, one in enumerate(sets)}
    return found


def _width(stream: str) -> int:
    return _WIDTHS[stream] if stream in _WIDTHS else _SETS[stream.split()[0]][1]


def _checked(blocks: Iterable[Any], name: str, shared: SharedMaterials) -> Iterator[Rows]:
    """The arrays of each block that has triangles. Materials of meshes are added to those known."""
    known: list[Material] | None = None
    numbers = np.zeros(0, np.uint32)
    is_empty = True
    for k, block in enumerate(blocks):
        place = f"{name}: block {k}"
        mesh: dict[str, Any]
        if isinstance(block, Mesh):
            mesh = {key: getattr(block, key) for key in _WIDTHS} | _sets(block)
            mesh |= {"positions": block.world_positions, "triangles": block.triangles}
            if block.material_ids is not None:
                if block.materials != known:
                    known = block.materials
                    numbers = np.array(shared.add(block.materials), np.uint32)
                mesh["materials"] = _numbered(block.material_ids, numbers)
        elif isinstance(block, (tuple, list)) and len(block) == 2:
            mesh = {"positions": block[0], "triangles": block[1]}
        else:
            mesh = {key: getattr(block, key, None) for key in (*_WIDTHS, "triangles", "materials")}
        if mesh.get("positions") is None or mesh.get("triangles") is None:
            raise Error(f"{place} has no positions or no triangles")
        triangles = to_uint32(_rows(mesh["triangles"], 3, f"{place}: triangles"))
        arrays = {
            key: _rows(mesh[key], _width(key), f"{place}: {key}")
            for key in (*_WIDTHS, *(key for key in mesh if " " in key))
            if mesh.get(key) is not None
        }
        count = len(arrays["positions"])
        for key, array in arrays.items():
            if len(array) != count:
                raise Error(f"{place} has {count} positions and {len(array)} of {key}")
        is_empty = False
        if not len(triangles):
            continue
        if int(triangles.max()) >= count:
            wrong = int(np.argmax((triangles >= count).any(axis=1)))
            raise Error(
                f"{place}: triangle {wrong} has vertex index {int(triangles[wrong].max())}, of "
                f"{count} there are"
            )
        materials = mesh.get("materials")
        if materials is not None and np.shape(materials) != (len(triangles),):
            raise Error(f"{place}: materials must have one entry a triangle")
        yield arrays, triangles, None if materials is None else to_uint32(np.asarray(materials))
    # Most likely an iterator that has been used up; a mesh without triangles is one.
    if is_empty:
        raise Error(f"there are no blocks in {name}")


def _rows(values: Any, width: int, what: str) -> NDArray[Any]:
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != width or array.dtype.kind not in "fiu":
        raise Error(f"{what} must have {width} numbers a row, not shape {array.shape}")
    return array


def _next(rows: Iterator[Rows]) -> Rows | None:
    try:
        return next(rows, None)
    except OSError as error:
        raise _NoBlock from error


def _spool_part(
    layout: Layout,
    first: Rows,
    more: Iterator[Rows],
    name: str,
    streams: list[str],
    numbers: list[int] | None = None,
) -> Rows | None:
    """Writes blocks to one part until 32 bits cannot number its vertices; gives the block that is
    the first of the next part."""
    has_materials = first[2] is not None
    types = {key: "<f8" if key == "positions" else "<f4" for key in streams}
    vertex = np.dtype([(key, types[key], (_width(key),)) for key in streams])
    face = np.dtype([("v", "<u4", (3,))] + ([("material", "<u4")] if has_materials else []))
    paths = layout.new_file(".vertices"), layout.new_file(".triangles")
    counts = [0, 0]
    rest: Rows | None = first
    with replacing(paths[0], False) as vertices, replacing(paths[1], False) as faces:
        while rest is not None and counts[0] + len(rest[0]["positions"]) <= _MOST_VERTICES:
            arrays, triangles, materials = rest
            if list(arrays) != streams or (materials is not None) != has_materials:
                raise Error(f"{name}: a block has other streams than the first")
            for begin in range(0, len(arrays["positions"]), _BLOCK):
                piece = {key: array[begin : begin + _BLOCK] for key, array in arrays.items()}
                out = np.empty(len(piece["positions"]), vertex)
                for key, array in piece.items():
                    out[key] = array
                vertices.write(out.tobytes())
            for begin in range(0, len(triangles), _BLOCK):
                some = triangles[begin : begin + _BLOCK]
                out = np.empty(len(some), face)
                out["v"] = some + np.uint32(counts[0])
                if materials is not None:
                    out["material"] = materials[begin : begin + _BLOCK]
                faces.write(out.tobytes())
            counts[0] += len(arrays["positions"])
            counts[1] += len(triangles)
            rest = _next(more)
    columns: dict[str, Column] = {}
    extras: list[Extra] = []
    table = layout.add_table(layout.add_file(paths[0]), 0, vertex.itemsize, counts[0])
    for key in streams:
        base = vertex.fields[key][1] if vertex.fields else 0
        size = np.dtype(types[key]).itemsize
        places = [base + size * k for k in range(_width(key))]
        column: Column = (table, types[key][1:], places, False)
        if key in _WIDTHS:
            columns[key] = column
        else:
            kind, number = key.split()
            extras.append((_SETS[kind][0], int(number), column))
    table = layout.add_table(layout.add_file(paths[1]), 0, face.itemsize, counts[1])
    columns["indices"] = (table, "u4", [0, 4, 8], False)
    if has_materials:
        columns["materials"] = (table, "u4", [12], False)
        numbers = numbers or []
    layout.add_part(name, columns, counts[1], extras=extras, numbers=numbers)
    return rest
