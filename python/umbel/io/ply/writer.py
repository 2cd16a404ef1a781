"""Writes a mesh as binary little-endian PLY."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import warn_lost
from umbel.geometry.mesh import Material, Mesh
from umbel.io.colors import to_srgb
from umbel.io.files import write_all
from umbel.io.format_losses import attribute_losses, copyright_line, reference_losses
from umbel.io.ply import names as ply_names

_BYTE = 0.01
"""How far from a whole number a colour may be that is a byte, as bytes are made floats."""
_TYPES = {"|u1": "uchar", "<f4": "float", "<f8": "double"}


def write_ply(path: Path, mesh: Mesh) -> None:
    """Writes binary little-endian PLY, positions as doubles in the world where the mesh has an
    origin. Floats are kept to the bit; colours become bytes, and of the materials only their
    numbers stay. One warning names what PLY cannot hold."""
    n, m = len(mesh.positions), len(mesh.triangles)
    points: NDArray[Any] = mesh.vertices
    kind = points.dtype.newbyteorder("<").str
    fields: list[tuple[str, str, Any]] = [
        (name, kind, points[:, k]) for k, name in enumerate(ply_names.POSITION[0])
    ]
    for names, array in (
        (ply_names.NORMAL[0], mesh.normals),
        (ply_names.UV[0], mesh.uvs),
        (ply_names.TANGENT[0], mesh.tangents),
    ):
        if array is not None:
            fields += [(name, "<f4", array[:, k]) for k, name in enumerate(names)]
    is_rounded = False
    if mesh.colors is not None:
        with np.errstate(invalid="ignore", over="ignore"):
            exact = mesh.colors * np.float32(255.0)
            exact[:, :3] = to_srgb(mesh.colors[:, :3]) * np.float32(255.0)
            colors = np.nan_to_num(np.clip(np.rint(exact), 0, 255)).astype(np.uint8)
            is_rounded = not (np.abs(exact - colors) <= _BYTE).all()
        names = (*ply_names.COLOR[0], *ply_names.ALPHA[0])
        fields += [(name, "|u1", colors[:, k]) for k, name in enumerate(names)]
    vertices = np.empty(n, [(name, kind) for name, kind, _ in fields])
    for name, _, values in fields:
        vertices[name] = values
    face_fields: list[tuple[Any, ...]] = [("n", "u1"), ("v", "<i4", (3,))]
    if mesh.material_ids is not None:
        face_fields.append(("material_index", "<i4"))
    faces = np.empty(m, face_fields)
    faces["n"] = 3
    faces["v"] = mesh.triangles.view(np.int32)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {n}"]
    lines += [f"property {_TYPES[kind]} {name}" for name, kind, _ in fields]
    lines += [f"element face {m}", "property list uchar int vertex_indices"]
    if mesh.material_ids is not None:
        faces["material_index"] = mesh.material_ids.view(np.int32)
        lines.append("property int material_index")
    if copyright_line(mesh):
        lines.insert(2, f"comment {copyright_line(mesh)}")
    lost = [*_material_losses(mesh), *attribute_losses(mesh)]
    lost += reference_losses(path, mesh.coordinates)
    lost += ["colours between 8-bit steps"] if is_rounded else []
    if lost:
        warn_lost(f"{path}: PLY has no place for", lost, most=8)
    header = "\n".join([*lines, "end_header", ""]).encode()
    write_all(path, [header, vertices.tobytes(), faces.tobytes()])


def _material_losses(mesh: Mesh) -> list[str]:
    if mesh.material_ids is None or not any(one != Material() for one in mesh.materials):
        return []
    count = len(mesh.materials)
    lost = [f"{count} materials but for their numbers" if count > 1 else "the material"]
    if any(one.images for one in mesh.materials):
        lost.append("textures")
    return lost
