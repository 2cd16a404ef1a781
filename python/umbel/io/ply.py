"""PLY, ASCII and binary of either byte order (Turk 1994), with the properties that scanners and
modellers write: normals, colours, texture coordinates at vertices or face corners, polygons,
triangle strips, material indices. Anything else in a file is stepped over.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.io.files import numbers
from umbel.io.polygons import fans, strips
from umbel.io.scene import Instance, Scene
from umbel.mesh import (
    Float32Array,
    Material,
    Mesh,
    UInt32Array,
    to_uint32,
    to_unit_floats,
    unit_normals,
)

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 20
_MOST_MATERIALS = 1 << 16

POSITION = [("x", "y", "z")]
NORMAL = [("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z")]
UV = [("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t")]
COLOR = [("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green",
          "diffuse_blue")]  # fmt: skip
ALPHA = [("alpha",), ("a",), ("diffuse_alpha",)]
TANGENT = [("tx", "ty", "tz", "tw")]
_INDEX_LISTS = ("vertex_indices", "vertex_index")
_MATERIAL_ID = ("material_index", "material_id", "material")


@dataclass
class _Property:
    name: str
    type: str
    count_type: str | None = None  # of a list


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        return any(p.count_type for p in self.properties)


@dataclass
class _List:
    """A list property of all rows: row i holds values[sum of counts before i, + counts[i])."""

    counts: NDArray[np.int64]
    values: NDArray[Any]


_Columns = dict[str, Any]  # property name -> array of one value a row, or _List


def read_ply(data: bytes, where: str) -> Scene:
    """The scene in a PLY file's bytes; `where` names the file in errors."""
    byte_order, elements, body = _header(data, where)
    columns: dict[str, _Columns] = {}
    ascii_values = None
    if byte_order == "=":
        ascii_values = numbers(data[body:], None, f"{where}, after the header")
        body = 0
    for element in elements:
        if ascii_values is not None:
            columns[element.name], body = _ascii_element(ascii_values, body, element, where)
        else:
            columns[element.name], body = _binary_element(data, body, element, byte_order, where)
    mesh = _mesh(columns, where)
    return Scene([mesh], mesh.materials, [Instance(0)])


# --- header -----------------------------------------------------------------------------------


def _header(data: bytes, where: str) -> tuple[str, list[_Element], int]:
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    if not first:
        raise Error(f"{where} is no PLY file: it does not begin with 'ply'")
    newline = first.group(1)
    end = re.search(rb"[\r\n]end_header[ \t]*" + newline, data[:_LONGEST_HEADER])
    if not end:
        raise Error(f"{where} is cut short or corrupt: its header has no 'end_header'")
    byte_order = ""
    elements: list[_Element] = []
    for line in data[first.end() : end.start()].decode("latin-1").splitlines():
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) >= 2 and words[1] in _BYTE_ORDERS:
            byte_order = _BYTE_ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isdecimal():
            if any(e.name == words[1] for e in elements):
                raise Error(f"{where}: the header has two elements named {words[1]!r}")
            elements.append(_Element(words[1], int(words[2][:20])))
        elif words[0] == "property" and elements:
            elements[-1].properties.append(_property(words, line, where))
        else:
            raise Error(f"{where}: header line {line[:80]!r} makes no sense")
    if not byte_order:
        raise Error(f"{where}: the header names no known format")
    return byte_order, elements, end.end()


def _property(words: list[str], line: str, where: str) -> _Property:
    if len(words) == 3 and words[1] in _TYPES:
        return _Property(words[2], _TYPES[words[1]])
    if len(words) == 5 and words[1] == "list" and words[2] in _TYPES and words[3] in _TYPES:
        return _Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
    raise Error(f"{where}: header line {line[:80]!r} makes no sense")


# --- elements ---------------------------------------------------------------------------------


def _short(element: _Element, rows: int, where: str) -> Error:
    return Error(
        f"{where} is cut short or corrupt: the header says {element.count} of element "
        f"{element.name!r}, the data holds {rows}"
    )


def _bad_count(element: _Element, row: int, count: float, where: str) -> Error:
    return Error(f"{where}: a list of element {element.name!r}, row {row}, has length {count}")


def _dtype(element: _Element, byte_order: str, lengths: list[int]) -> np.dtype[Any]:
    fields: list[tuple[str, Any]] = []
    at = iter(lengths)
    for k, p in enumerate(element.properties):
        if p.count_type:
            fields.append((f"n{k}", byte_order + p.count_type))
            fields.append((f"p{k}", (byte_order + p.type, (next(at),))))
        else:
            fields.append((f"p{k}", byte_order + p.type))
    return np.dtype(fields)


def _binary_element(
    data: bytes, start: int, element: _Element, byte_order: str, where: str
) -> tuple[_Columns, int]:
    if not element.properties or not element.count:
        return {p.name: _empty(p) for p in element.properties}, start
    shortest = _dtype(element, byte_order, [0] * len(element.properties)).itemsize
    if element.count * shortest > len(data) - start:
        raise _short(element, (len(data) - start) // shortest, where)
    columns = _uniform_rows(data, start, element, byte_order)
    if columns is not None:
        return columns
    return _ragged_rows(data, start, element, byte_order, where)


def _empty(p: _Property) -> Any:
    values = np.zeros(0, p.type)
    return _List(np.zeros(0, np.int64), values) if p.count_type else values


def _uniform_rows(
    data: bytes, start: int, element: _Element, byte_order: str
) -> tuple[_Columns, int] | None:
    """All rows at once, if every row's lists are as long as the first row's; else None."""
    lengths: list[int] = []
    position = start
    for p in element.properties:
        size = np.dtype(p.type).itemsize
        if p.count_type:
            head = np.dtype(byte_order + p.count_type)
            if position + head.itemsize > len(data):
                return None
            count = np.frombuffer(data, head, 1, position)[0]
            if not 0 <= count <= len(data):
                return None
            lengths.append(int(count))
            position += head.itemsize + int(count) * size
        else:
            position += size
    if (position - start) * element.count > len(data) - start:
        return None
    rows = np.frombuffer(data, _dtype(element, byte_order, lengths), element.count, start)
    columns: _Columns = {}
    at = iter(lengths)
    for k, p in enumerate(element.properties):
        values = rows[f"p{k}"]
        if p.count_type:
            length = next(at)
            if not (rows[f"n{k}"] == length).all():
                return None
            columns[p.name] = _List(
                np.full(element.count, length, np.int64), values.reshape(element.count * length)
            )
        else:
            columns[p.name] = values
    return columns, position + (position - start) * (element.count - 1)


def _ragged_rows(
    data: bytes, start: int, element: _Element, byte_order: str, where: str
) -> tuple[_Columns, int]:
    """Rows whose lists differ in length: found one by one, then gathered all at once."""
    sizes = [np.dtype(p.type).itemsize for p in element.properties]
    heads = [np.dtype(p.count_type).itemsize if p.count_type else 0 for p in element.properties]
    order = "big" if byte_order == ">" else "little"
    offsets: list[list[int]] = [[] for _ in element.properties]
    counts: list[list[int]] = [[] for _ in element.properties]
    single_bytes = [p.count_type == "u1" for p in element.properties]
    steps = list(zip(heads, sizes, single_bytes, offsets, counts, element.properties, strict=True))
    position, end = start, len(data)
    for row in range(element.count):
        for head, size, single, column_offsets, column_counts, p in steps:
            if head:
                if position + head > end:
                    raise _short(element, row, where)
                if single:
                    count = data[position]
                else:
                    count = _list_length(data[position : position + head], p, order)
                    if count < 0:
                        raise _bad_count(element, row, count, where)
                position += head
                column_offsets.append(position)
                column_counts.append(count)
                position += count * size
            else:
                column_offsets.append(position)
                position += size
        if position > end:
            raise _short(element, row, where)
    raw = np.frombuffer(data, np.uint8)
    columns: _Columns = {}
    for k, p in enumerate(element.properties):
        first = np.array(offsets[k], np.int64)
        dtype = np.dtype(byte_order + p.type)
        if p.count_type:
            lengths = np.array(counts[k], np.int64)
            columns[p.name] = _List(lengths, _gather(raw, first, lengths, dtype))
        else:
            columns[p.name] = _gather(raw, first, np.ones(len(first), np.int64), dtype)
    return columns, position


def _list_length(raw: bytes, p: _Property, order: Any) -> int:
    assert p.count_type is not None
    if p.count_type[0] == "f":
        value = float(np.frombuffer(raw, (">" if order == "big" else "<") + p.count_type)[0])
        return int(value) if value >= 0 and value == value // 1 and value < 2**53 else -1
    return int.from_bytes(raw, order, signed=p.count_type[0] == "i")


def _gather(
    raw: NDArray[np.uint8], first: NDArray[np.int64], lengths: NDArray[np.int64], dtype: Any
) -> NDArray[Any]:
    """`lengths[i]` items from byte `first[i]` on, for all i one after another."""
    total = int(lengths.sum())
    out = np.empty((total, dtype.itemsize), np.uint8)
    starts = np.cumsum(lengths) - lengths
    for length in np.unique(lengths):
        if not length:
            continue
        rows = np.flatnonzero(lengths == length)
        source = first[rows, None] + np.arange(length * dtype.itemsize)
        target = starts[rows, None] + np.arange(length)
        out[target.reshape(-1)] = raw[source].reshape(-1, dtype.itemsize)
    return out.reshape(-1).view(dtype)


def _ascii_element(
    values: NDArray[Any], start: int, element: _Element, where: str
) -> tuple[_Columns, int]:
    if not element.properties or not element.count:
        return {p.name: _empty(p) for p in element.properties}, start
    columns_least = len(element.properties)
    if element.count * columns_least > len(values) - start:
        raise _short(element, (len(values) - start) // columns_least, where)
    if not element.has_lists:
        stop = start + element.count * columns_least
        table = values[start:stop].reshape(element.count, columns_least)
        return {p.name: _typed(table[:, k], p.type) for k, p in enumerate(element.properties)}, stop
    # A file of numbers is a binary file whose every item is a double.
    doubles = _Element(
        element.name,
        element.count,
        [_Property(p.name, "f8", "f8" if p.count_type else None) for p in element.properties],
    )
    raw = values[start:].tobytes()
    columns, stop = _binary_element(raw, 0, doubles, "=", where)
    for p in element.properties:
        column = columns[p.name]
        if isinstance(column, _List):
            columns[p.name] = _List(column.counts, _typed(column.values, p.type))
        else:
            columns[p.name] = _typed(column, p.type)
    return columns, start + stop // 8


def _typed(values: NDArray[Any], type_name: str) -> NDArray[Any]:
    """Numbers of an ASCII file as their declared type, where that keeps them; wide indices stay."""
    dtype = np.dtype(type_name)
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            return values.astype(dtype)
    info = np.iinfo(dtype)
    fits = dtype.itemsize < 8 and bool(((values >= info.min) & (values <= info.max)).all())
    return values.astype(dtype) if fits else values


# --- mesh -------------------------------------------------------------------------------------


def _stack(columns: _Columns, choices: Sequence[tuple[str, ...]]) -> NDArray[Any] | None:
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


def _mesh(columns: dict[str, _Columns], where: str) -> Mesh:
    vertex = columns.get("vertex")
    if vertex is None:
        raise Error(f"{where} has no element 'vertex'")
    points = _stack(vertex, POSITION)
    if points is None:
        raise Error(f"{where}: element 'vertex' lacks x, y or z")
    faces = columns.get("face", {})
    normals = _floats(_stack(vertex, NORMAL))
    triangles, parents = _triangles(columns, where)
    materials, ids = _materials(faces, parents, where)
    mesh = Mesh(
        points,
        triangles,
        normals=None if normals is None else unit_normals(normals),
        tangents=_floats(_stack(vertex, TANGENT)),
        uvs=_floats(_stack(vertex, UV)),
        colors=_vertex_colors(vertex),
        material_ids=ids,
        materials=materials,
    )
    return _with_corner_uvs(mesh, faces)


def _vertex_colors(vertex: _Columns) -> Float32Array | None:
    rgb = _stack(vertex, COLOR)
    if rgb is None:
        return None
    out = np.ones((len(rgb), 4), np.float32)
    out[:, :3] = _unit(rgb)
    alpha = _stack(vertex, ALPHA)
    if alpha is not None:
        out[:, 3:] = _unit(alpha)
    return out


def _unit(values: NDArray[Any]) -> Float32Array:
    units = to_unit_floats(values)
    if values.dtype.kind == "f" and len(values) and np.nanmax(units, initial=0.0) > 1.0:
        units = units / np.float32(255.0)  # bytes that were declared as floats
    return units


def _index_list(columns: _Columns, element: str, where: str) -> _List | None:
    for name in _INDEX_LISTS:
        column = columns.get(name)
        if isinstance(column, _List):
            return column
    if columns and element == "face":
        raise Error(f"{where}: element 'face' has no list 'vertex_indices'")
    return None


def _triangles(
    columns: dict[str, _Columns], where: str
) -> tuple[UInt32Array, NDArray[np.int64] | None]:
    """The triangles, and for each the face that it came from (None: its own number)."""
    polygons = _index_list(columns.get("face", {}), "face", where)
    parents: NDArray[np.int64] | None = None
    triangles = np.zeros((0, 3), np.uint32)
    if polygons is not None:
        indices = to_uint32(polygons.values)
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
    faces: _Columns, parents: NDArray[np.int64] | None, where: str
) -> tuple[list[Material], UInt32Array | None]:
    column = next((faces[k] for k in _MATERIAL_ID if isinstance(faces.get(k), np.ndarray)), None)
    if column is None or column.dtype.kind == "f":
        return [], None
    if parents is not None:
        column = np.where(parents >= 0, column[np.maximum(parents, 0)], 0) if len(column) else None
    if column is None or not len(column):
        return [], None
    low, high = int(column.min()), int(column.max())
    if low < 0 or high >= _MOST_MATERIALS:
        warnings.warn(
            f"{where}: material indices run from {low} to {high} and are left out",
            LoadWarning,
            stacklevel=2,
        )
        return [], None
    return [Material(name=f"material_{k}") for k in range(high + 1)], column.astype(np.uint32)


def _with_corner_uvs(mesh: Mesh, faces: _Columns) -> Mesh:
    """Splits vertices so that each corner has the texture coordinate that its face lists."""
    wedge = faces.get("texcoord")
    polygons = next((faces[k] for k in _INDEX_LISTS if k in faces), None)
    if mesh.uvs is not None or not isinstance(wedge, _List) or not isinstance(polygons, _List):
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
