"""Writes a mesh as a .glb: one node, one vertex buffer, a primitive for each run of triangles of
the same material."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.io.files import write_all
from umbel.io.gltf_materials import Json, write_material
from umbel.mesh import Mesh, UInt32Array

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963
_MOST_BYTES = 0xFFFFFFFF
_RUNS_PER_MATERIAL = 4
_MOST_JOINT = 0xFFFF


class _Writer:
    def __init__(self) -> None:
        self.root: Json = {
            "asset": {"version": "2.0", "generator": "umbel"},
            "scene": 0,
            "scenes": [{}],
            "accessors": [],
            "bufferViews": [],
        }
        self.chunks: list[bytes] = []
        self.size = 0

    def view(self, data: NDArray[Any], target: int) -> int:
        raw = data.tobytes()
        self.root["bufferViews"].append(
            {"buffer": 0, "byteOffset": self.size, "byteLength": len(raw), "target": target}
        )
        raw += b"\0" * (-len(raw) % 4)
        self.chunks.append(raw)
        self.size += len(raw)
        return len(self.root["bufferViews"]) - 1

    def accessor(self, view: int, kind: int, width: str, count: int, offset: int = 0) -> Json:
        entry: Json = {"bufferView": view, "componentType": kind, "type": width, "count": count}
        if offset:
            entry["byteOffset"] = offset
        self.root["accessors"].append(entry)
        return entry

    def attribute(self, array: NDArray[Any], width: str, kind: int = _FLOAT) -> int:
        data = array.astype("<f4" if kind == _FLOAT else "<u2")
        self.accessor(self.view(data, _VERTICES), kind, width, len(array))
        return len(self.root["accessors"]) - 1


def write_glb(path: Path, mesh: Mesh) -> None:
    """Writes the mesh; every float is kept to the bit. Triangles are put in order of material
    only where materials change too often for one primitive each run."""
    writer = _Writer()
    if len(mesh.triangles):
        if int(mesh.triangles.max()) >= len(mesh.positions):
            raise Error(f"cannot write {path}: a triangle points beyond the vertices")
        attributes = _attributes(writer, mesh)
        triangles, runs = _runs(mesh)
        primitives = _primitives(writer, attributes, triangles, runs, len(mesh.positions))
        materials = [write_material(m) for m in mesh.materials]
        if materials and mesh.material_ids is not None:
            writer.root["materials"] = materials
            used = sorted({k for m in materials for k in m.get("extensions", {})})
            if used:
                writer.root["extensionsUsed"] = used
        writer.root["meshes"] = [{"name": mesh.name or path.stem, "primitives": primitives}]
        writer.root["nodes"] = [{"mesh": 0}]
        writer.root["scenes"] = [{"nodes": [0]}]
    write_all(path, _glb(writer, path))


def _attributes(writer: _Writer, mesh: Mesh) -> Json:
    attributes: Json = {"POSITION": writer.attribute(mesh.positions, "VEC3")}
    entry = writer.root["accessors"][0]
    finite = mesh.positions[np.isfinite(mesh.positions).all(axis=1)]
    corners = finite if len(finite) else np.zeros((1, 3), np.float32)
    entry["min"], entry["max"] = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    for key, array, width in (
        ("NORMAL", mesh.normals, "VEC3"),
        ("TANGENT", mesh.tangents, "VEC4"),
        ("TEXCOORD_0", mesh.uvs, "VEC2"),
        ("COLOR_0", mesh.colors, "VEC4"),
    ):
        if array is not None:
            attributes[key] = writer.attribute(array, width)
    for k, uvs in enumerate(mesh.uv_sets):
        attributes[f"TEXCOORD_{k + 1}"] = writer.attribute(uvs, "VEC2")
    if mesh.joints is not None and mesh.weights is not None:
        if mesh.joints.size and int(mesh.joints.max()) > _MOST_JOINT:
            raise Error(f"a .glb cannot hold the joint {int(mesh.joints.max())}")
        for k in range(mesh.joints.shape[1] // 4):
            columns = slice(4 * k, 4 * k + 4)
            attributes[f"JOINTS_{k}"] = writer.attribute(mesh.joints[:, columns], "VEC4", _UINT16)
            attributes[f"WEIGHTS_{k}"] = writer.attribute(mesh.weights[:, columns], "VEC4")
    return attributes


def _runs(mesh: Mesh) -> tuple[UInt32Array, list[tuple[int, int, int | None]]]:
    """The triangles, and ranges of them that have one material."""
    triangles, ids = mesh.triangles, mesh.material_ids
    if ids is None:
        return triangles, [(0, len(triangles), None)]
    if np.count_nonzero(np.diff(ids)) >= _RUNS_PER_MATERIAL * len(np.unique(ids)):
        order = np.argsort(ids, kind="stable")
        triangles, ids = triangles[order], ids[order]
    edges = [0, *(np.flatnonzero(np.diff(ids)) + 1).tolist(), len(ids)]
    known = len(mesh.materials)
    return triangles, [(a, b, int(ids[a]) if ids[a] < known else None) for a, b in pairwise(edges)]


def _primitives(
    writer: _Writer,
    attributes: Json,
    triangles: UInt32Array,
    runs: list[tuple[int, int, int | None]],
    vertices: int,
) -> list[Json]:
    small = vertices <= 0xFFFF
    kind, size = (_UINT16, 2) if small else (_UINT32, 4)
    view = writer.view(triangles.astype("<u2" if small else "<u4"), _INDICES)
    primitives = []
    for start, stop, material in runs:
        writer.accessor(view, kind, "SCALAR", 3 * (stop - start), 3 * start * size)
        primitive: Json = {"attributes": attributes, "indices": len(writer.root["accessors"]) - 1}
        if material is not None:
            primitive["material"] = material
        primitives.append(primitive)
    return primitives


def _glb(writer: _Writer, path: Path) -> list[bytes]:
    root = {k: v for k, v in writer.root.items() if v != []}
    if writer.size:
        root["buffers"] = [{"byteLength": writer.size}]
    text = json.dumps(root, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + (8 + writer.size if writer.size else 0)
    if total > _MOST_BYTES:
        raise Error(f"cannot write {path}: {total} bytes are more than a .glb can hold")

    def word(*values: int) -> bytes:
        return b"".join(v.to_bytes(4, "little") for v in values)

    out = [b"glTF", word(2, total), word(len(text)), b"JSON", text]
    if writer.size:
        out += [word(writer.size), b"BIN\0", *writer.chunks]
    return out
