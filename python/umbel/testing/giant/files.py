"""Giants as files, in a memory that does not grow with them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.io.files import write_all
from umbel.testing.giant.mesh import BLOCK, Block, Giant, Vertices

_MOST_INDICES = 2**32 - 1
_MOST_GLB = 2**32 - 1
#: Floats hold multiples of 2^-10 below this.
_EXACT = 2.0**14


def write(mesh: Giant, path: str | os.PathLike[str], dtype: Any = None) -> None:
    """Writes one file: binary .ply or .stl, .obj, .glb. It has its name only when it is whole.

    dtype: of a PLY file's positions; float64 if the mesh has an origin, else float32.
    """
    file = Path(path)
    writers = {".ply": _ply, ".stl": _stl, ".obj": _obj, ".glb": _glb}
    if file.suffix.lower() not in writers:
        raise Error(f"{file}: giants are written as {', '.join(writers)}")
    if dtype is None:
        dtype = np.float64 if any(mesh.origin) else np.float32
    write_all(file, writers[file.suffix.lower()](mesh, file, np.dtype(dtype)))


def write_tiles(
    mesh: Giant,
    folder: str | os.PathLike[str],
    extension: str = ".ply",
    triangles: int | None = None,
) -> list[Path]:
    """Writes the mesh as many files, `triangles` in each (a scan: its tiles), and gives their
    names. Vertices that files share are in each of them, with equal positions."""
    size = triangles or mesh.tile_triangles
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    paths = []
    for k, begin in enumerate(range(0, mesh.triangle_count, size)):
        paths.append(target / f"tile_{k:06d}{extension}")
        write(_Part(mesh, begin, min(begin + size, mesh.triangle_count)), paths[-1])
    return paths


class _Part(Giant):
    """Some of a mesh's triangles as a mesh, which is in memory."""

    def __init__(self, mesh: Giant, begin: int, end: int) -> None:
        block = mesh.block(begin, end)
        self._vertices = Vertices(block.positions, block.uvs)
        self._triangles = block.triangles.astype(np.int64)
        self._materials = block.materials
        self.triangle_count, self.vertex_count = len(block.triangles), len(block.positions)
        self.origin, self.has_uvs = mesh.origin, mesh.has_uvs
        self.material_count = mesh.material_count

    def vertices_of(self, ids: NDArray[np.int64]) -> Vertices:
        return self._vertices[ids]

    def triangles_of(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        return self._triangles[ids]

    def materials_of(self, ids: NDArray[np.int64]) -> NDArray[np.uint32] | None:
        return None if self._materials is None else self._materials[ids]


def _ranges(count: int, size: int = BLOCK) -> Iterator[tuple[int, int]]:
    return ((begin, min(begin + size, count)) for begin in range(0, count, size))


def _ply(mesh: Giant, path: Path, dtype: np.dtype[Any]) -> Iterable[bytes]:
    _check_indices(mesh, path)
    kind = dtype.newbyteorder("<").str
    names = {"<f4": "float", "<f8": "double"}
    fields: list[tuple[str, str]] = [(name, kind) for name in "xyz"]
    fields += [(name, "<f4") for name in "st"] if mesh.has_uvs else []
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {mesh.vertex_count}"]
    lines += [f"property {names[kind]} {name}" for name, kind in fields]
    lines += [f"element face {mesh.triangle_count}"]
    lines += [
        f"property list uchar {'int' if mesh.vertex_count < 2**31 else 'uint'} vertex_indices"
    ]
    face: list[Any] = [("n", "u1"), ("v", "<u4", (3,))]
    if mesh.material_count:
        lines.append("property int material_index")
        face.append(("material", "<u4"))
    yield "\n".join([*lines, "end_header", ""]).encode()
    for begin, end in _ranges(mesh.vertex_count):
        vertices = mesh.vertices(begin, end)
        rows = np.empty(end - begin, fields)
        for k, name in enumerate("xyz"):
            rows[name] = vertices.positions[:, k]
        if vertices.uvs is not None:
            rows["s"], rows["t"] = vertices.uvs[:, 0], vertices.uvs[:, 1]
        yield rows.tobytes()
    for begin, end in _ranges(mesh.triangle_count):
        faces = np.empty(end - begin, face)
        faces["n"], faces["v"] = 3, mesh.triangles(begin, end)
        if mesh.material_count:
            faces["material"] = mesh.materials_of(np.arange(begin, end))
        yield faces.tobytes()


def _check_indices(mesh: Giant, path: Path) -> None:
    if mesh.vertex_count > _MOST_INDICES:
        raise Error(f"{path}: {mesh.vertex_count} vertices are more than 32-bit indices can number")


def _stl(mesh: Giant, path: Path, dtype: np.dtype[Any]) -> Iterable[bytes]:
    if mesh.triangle_count > _MOST_INDICES:
        raise Error(f"{path}: STL counts no more than 2^32 - 1 triangles")
    yield b"umbel".ljust(80) + mesh.triangle_count.to_bytes(4, "little")
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    for block in mesh.blocks():
        rows = np.zeros(len(block.triangles), record)
        rows["corners"] = (block.positions - mesh.origin)[block.triangles]
        yield rows.tobytes()


def _obj(mesh: Giant, path: Path, dtype: np.dtype[Any]) -> Iterable[bytes]:
    size = 1 << 16
    for begin, end in _ranges(mesh.vertex_count, size):
        vertices = mesh.vertices(begin, end)
        yield _lines("v %.17g %.17g %.17g\n", vertices.positions)
        if vertices.uvs is not None:
            yield _lines("vt %.9g %.9g\n", vertices.uvs)
    for begin, end in _ranges(mesh.triangle_count, size):
        corners = mesh.triangles(begin, end) + 1
        if mesh.has_uvs:
            yield _lines("f %d/%d %d/%d %d/%d\n", np.repeat(corners, 2, axis=1))
        else:
            yield _lines("f %d %d %d\n", corners)


def _lines(pattern: str, values: NDArray[Any]) -> bytes:
    return ((pattern * len(values)) % tuple(values.reshape(-1).tolist())).encode()


# --- GLB --------------------------------------------------------------------------------------


def _glb(mesh: Giant, path: Path, dtype: np.dtype[Any]) -> Iterable[bytes]:
    """A mesh and a node for each block, moved by whole numbers, which loses nothing."""
    bounds = [(len(b.positions), len(b.triangles), *_box(b)) for b in mesh.blocks()]
    spans = np.array([high - low for _, _, low, high in bounds])
    # Blocks that floats can hold exactly have places of their own, others share one.
    apart = bool((spans < _EXACT).all())
    shared = np.array(mesh.origin)
    entries = [
        (vertices, triangles, np.floor(low) if apart else shared, low, high)
        for vertices, triangles, low, high in bounds
    ]
    body, size = _glb_json(mesh, entries)
    _check_glb_size(28 + len(body) + size, path)
    yield b"glTF" + (2).to_bytes(4, "little") + (28 + len(body) + size).to_bytes(4, "little")
    yield len(body).to_bytes(4, "little") + b"JSON" + body
    yield size.to_bytes(4, "little") + b"BIN\0"
    for block, (_, _, place, _, _) in zip(mesh.blocks(), entries, strict=True):
        yield (block.positions - place).astype("<f4").tobytes()
        if block.uvs is not None:
            yield block.uvs.astype("<f4").tobytes()
        for corners in _by_material(mesh, block):
            yield corners.astype("<u4").tobytes()


def _check_glb_size(size: int, path: Path) -> None:
    if size > _MOST_GLB:
        raise Error(f"{path}: {size} bytes are more than a .glb can hold; use write_tiles")


def _box(block: Block) -> tuple[NDArray[Any], NDArray[Any]]:
    return block.positions.min(axis=0), block.positions.max(axis=0)


def _by_material(mesh: Giant, block: Block) -> list[NDArray[np.uint32]]:
    if block.materials is None:
        return [block.triangles]
    return [block.triangles[block.materials == k] for k in range(mesh.material_count)]


def _glb_json(mesh: Giant, entries: list[tuple[int, int, Any, Any, Any]]) -> tuple[bytes, int]:
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    meshes, nodes, at = [], [], 0

    def add(count: int, kind: str, component: int, size: int, **more: Any) -> int:
        nonlocal at
        views.append({"buffer": 0, "byteOffset": at, "byteLength": count * size})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": component, "count": count,
             "type": kind, **more}
        )  # fmt: skip
        at += count * size
        return len(accessors) - 1

    for k, (vertices, triangles, place, low, high) in enumerate(entries):
        box = [np.float32(corner - place).tolist() for corner in (low, high)]
        attributes = {"POSITION": add(vertices, "VEC3", 5126, 12, min=box[0], max=box[1])}
        if mesh.has_uvs:
            attributes["TEXCOORD_0"] = add(vertices, "VEC2", 5126, 8)
        primitives = []
        for material, count in enumerate(_material_counts(mesh, k, triangles)):
            primitive: dict[str, Any] = {"attributes": attributes}
            primitive["indices"] = add(3 * count, "SCALAR", 5125, 4)
            if mesh.material_count:
                primitive["material"] = material
            primitives.append(primitive)
        meshes.append({"primitives": primitives})
        nodes.append({"mesh": k, "translation": place.tolist()})
    root: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "umbel.testing.giant"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": at}],
    }
    if mesh.material_count:
        root["materials"] = [{"name": f"material_{k}"} for k in range(mesh.material_count)]
    body = json.dumps(root, separators=(",", ":")).encode()
    return body + b" " * (-len(body) % 4), at


def _material_counts(mesh: Giant, block: int, triangles: int) -> list[int]:
    begin = block * BLOCK
    materials = mesh.materials_of(np.arange(begin, begin + triangles))
    if materials is None:
        return [triangles]
    counts: list[int] = np.bincount(materials, minlength=mesh.material_count).tolist()
    return counts
