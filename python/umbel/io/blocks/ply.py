"""Binary PLY as tables."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Material
from umbel.io.blocks.layout import Column, Layout
from umbel.io.files import GZIP, read_head, text_of
from umbel.io.ply import names as ply_names
from umbel.io.ply.data import LONGEST_HEADER, Element, read_header
from umbel.io.ply.losses import LIST, warn_of_losses
from umbel.io.ply.reader import MOST_MATERIALS, WHOLE_COLORS


def lay_out(layout: Layout, path: Path) -> bool:
    """Adds the file's tables; False if only the reader of whole files can read it."""
    head = read_head(path, LONGEST_HEADER)
    if head.startswith(GZIP) or head[:3] != b"ply":
        return False
    byte_order, elements, offset, _ = read_header(head, str(path))
    vertex = next((e for e in elements if e.name == "vertex"), None)
    faces = next((e for e in elements if e.name == "face"), None)
    if byte_order == "=" or vertex is None or faces is None or not faces.count:
        return False
    others = [e for e in elements if e is not faces]
    # Before anything is added or said, as the reader of whole files does both again.
    if any(e.has_lists or not e.properties for e in others) or not _vertex_columns(vertex, 0):
        return False
    length, big = path.stat().st_size, byte_order == ">"
    columns: dict[str, Column] = {}
    triangles = largest = 0
    file = layout.add_file(path)
    for element in elements:
        stride = sum(np.dtype(p.type).itemsize for p in element.properties)
        if element is faces:
            found = _faces(layout, path, file, element, offset, big)
            if found is None:
                return False
            triangles, more, offset, largest = found
            columns.update(more)
            continue
        if offset + stride * element.count > length:
            raise Error(
                f"{path}, byte {length}: the file is cut short or corrupt: the header says "
                f"{element.count} of element {element.name!r}, the data holds "
                f"{max(0, length - offset) // stride}"
            )
        if element is vertex:
            table = layout.add_table(file, offset, stride, element.count, big)
            columns.update(_vertex_columns(element, table))
        offset += stride * element.count
    if offset < length:
        _warn(
            f"{path}, byte {offset}: {length - offset} bytes after the last element are left out; "
            "do the header's counts lie?"
        )
    if vertex.count and not triangles:
        _warn(f"{path} has {vertex.count} vertices, and no triangles")
    kinds = {e.name: _kinds(e) for e in elements if e.count}
    warn_of_losses(kinds, head, str(path))
    numbers = None
    if "materials" in columns:
        named = [Material(name=f"material_{k}") for k in range(largest + 1)]
        numbers = layout.shared.add(named)
    layout.add_part(str(path), columns, triangles, srgb_colors=True, numbers=numbers)
    return True


def _kinds(element: Element) -> dict[str, str]:
    return {p.name: LIST if p.count_type else p.type[0] for p in element.properties}


def _vertex_columns(vertex: Element, table: int) -> dict[str, Column]:
    """The streams of vertices by name; none where one is not of one type."""
    properties = {p.name: p.type for p in vertex.properties}
    offsets, at = {}, 0
    for p in vertex.properties:
        offsets[p.name] = at
        at += np.dtype(p.type).itemsize

    def names_of(choices: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
        return next((names for names in choices if all(n in properties for n in names)), ())

    groups = {
        "positions": names_of(ply_names.POSITION),
        "normals": names_of(ply_names.NORMAL),
        "tangents": names_of(ply_names.TANGENT),
        "uvs": names_of(ply_names.UV),
        "colors": names_of(ply_names.COLOR),
    }
    if groups["colors"]:
        groups["colors"] += names_of(ply_names.ALPHA)
    columns: dict[str, Column] = {}
    for stream, names in groups.items():
        if not names:
            continue
        types = {properties[name] for name in names}
        if len(types) > 1 or (stream == "colors" and not types <= WHOLE_COLORS):
            return {}
        unit = stream == "colors"
        columns[stream] = (table, types.pop(), [offsets[name] for name in names], unit)
    return columns if "positions" in columns else {}


def _faces(
    layout: Layout, path: Path, file: int, faces: Element, offset: int, big: bool
) -> tuple[int, dict[str, Column], int, int] | None:
    """The number of triangles, the columns of indices and materials, where the faces end, and the
    largest material; None if only the reader of whole files can read them."""
    names = [p.name for p in faces.properties]
    lists = [name for name in ply_names.INDEX_LISTS if name in names]
    if not lists or ply_names.CORNER_UVS in names:
        return None
    index = names.index(lists[0])
    if faces.properties[index].count_type is None or faces.properties[index].type[0] == "f":
        return None
    material = next((names.index(name) for name in ply_names.MATERIAL_ID if name in names), None)
    if material is not None:
        one = faces.properties[material]
        material = None if one.count_type or one.type[0] == "f" else material
    rows = _umbel.FaceRows(
        path,
        text_of(path),
        offset,
        faces.count,
        big,
        [(p.type, p.count_type) for p in faces.properties],
        index,
        material,
    )
    scan = _umbel.scan_faces(rows)
    if scan.small_faces:
        _warn(f"{path}: {scan.small_faces} faces have fewer than three corners and are left out")
    low, high = scan.least_material, scan.largest_material
    if material is not None and (low < 0 or high >= MOST_MATERIALS):
        _warn(f"{path}: material indices run from {low} to {high} and are left out")
        material = None
    if scan.are_triangles:
        table = layout.add_table(file, offset, scan.row_bytes, faces.count, big)
        kind, at = faces.properties[index].type, scan.index_offset
        size = np.dtype(kind).itemsize
        columns: dict[str, Column] = {
            "indices": (table, kind, [at, at + size, at + 2 * size], False)
        }
        if material is not None:
            kind = faces.properties[material].type
            columns["materials"] = (table, kind, [scan.material_offset], False)
    else:
        made = layout.new_file(".triangles")
        _umbel.write_triangles(rows, made)
        table = layout.add_table(layout.add_file(made), 0, 16, scan.triangles)
        columns = {"indices": (table, "u4", [0, 4, 8], False)}
        if material is not None:
            columns["materials"] = (table, "u4", [12], False)
    return scan.triangles, columns, scan.end, high


def _warn(sentence: str) -> None:
    warnings.warn(sentence, LoadWarning, stacklevel=5)
