"""Surfaces on a grid, as the compressed arrays of glTF: KHR_mesh_quantization (positions as 16-bit
integers, directions as 8-bit ones) in streams of EXT_meshopt_compression."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.export.piece import DIRECTIONS, Doubles, Indices, Piece

Json = dict[str, Any]

EXTENSIONS = ("EXT_meshopt_compression", "KHR_mesh_quantization")
INSTANCING = "EXT_mesh_gpu_instancing"
_BYTE, _USHORT, _UINT, _FLOAT = 5120, 5123, 5125, 5126
_VERTICES, _INDICES = 34962, 34963
_UV_STEPS = 2.0**14
"""Texture coordinates are multiples of the inverse where they are floats."""


@dataclass(frozen=True)
class Quantized:
    """A surface on a grid: a row a vertex of each attribute, as it is stored."""

    rows: dict[str, NDArray[Any]]
    triangles: Indices
    materials: Indices | None
    is_ordered: bool = False  #: by `ordered`


class PackedArrays:
    """The buffer of a glTF file whose arrays are compressed."""

    def __init__(self) -> None:
        self.views: list[Json] = []
        self.accessors: list[Json] = []
        self.chunks: list[bytes] = []
        self.size = self.plain_size = 0
        self._blobs: dict[bytes, int] = {}

    def buffers(self) -> list[Json]:
        """The buffer of the file, and that which decoders fill."""
        plain: Json = {"byteLength": self.plain_size}
        plain["extensions"] = {EXTENSIONS[0]: {"fallback": True}}
        return (
            [{"byteLength": self.size}, plain] if self.plain_size else [{"byteLength": self.size}]
        )

    def blob(self, data: bytes) -> int:
        """A view of bytes as they are, the same one for equal bytes."""
        if data not in self._blobs:
            self._blobs[data] = len(self.views)
            self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(data)})
            self._append(data)
        return self._blobs[data]

    def _append(self, data: bytes) -> None:
        padded = data + b"\0" * (-len(data) % 4)
        self.chunks.append(padded)
        self.size += len(padded)

    def _stream(self, data: bytes, count: int, stride: int, mode: str, filtered: str = "") -> int:
        own: Json = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data)}
        own |= {"byteStride": stride, "count": count, "mode": mode}
        if filtered:
            own["filter"] = filtered
        view: Json = {"buffer": 1, "byteOffset": self.plain_size, "byteLength": count * stride}
        if mode == "ATTRIBUTES":
            view["byteStride"] = stride
        view["target"] = _VERTICES if mode == "ATTRIBUTES" else _INDICES
        self.views.append({**view, "extensions": {EXTENSIONS[0]: own}})
        self.plain_size += -(-count * stride // 4) * 4
        self._append(data)
        return len(self.views) - 1

    def attribute(self, name: str, rows: NDArray[Any]) -> int:
        """An accessor of a vertex attribute, stored as `quantized` made it."""
        count, width = rows.shape
        entry: Json = {"count": count}
        if name in DIRECTIONS:
            values = np.zeros((count, 4), np.float32)
            values[:, :width] = rows
            raw = _umbel.meshopt_encode_filter(values, "OCTAHEDRAL", 4, 8)
            entry |= {"componentType": _BYTE, "normalized": True}
        else:
            stride = -(-rows.itemsize * width // 4) * 4
            raw = np.zeros((count, stride), np.uint8)
            raw[:, : rows.itemsize * width] = np.ascontiguousarray(rows).view(np.uint8)
            entry["componentType"] = _USHORT if rows.dtype == np.uint16 else _FLOAT
            if rows.dtype == np.uint16 and name != "POSITION":
                entry["normalized"] = True
        data = _umbel.meshopt_encode_vertex(raw, 0)
        filtered = "OCTAHEDRAL" if name in DIRECTIONS else ""
        entry["bufferView"] = self._stream(data, count, raw.shape[1], "ATTRIBUTES", filtered)
        entry["type"] = "VEC4" if name == "TANGENT" else f"VEC{width}"
        if name == "POSITION":
            entry |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.accessors.append(entry)
        return len(self.accessors) - 1

    def indices(self, triangles: Indices, vertices: int) -> int:
        """An accessor of a triangle list."""
        flat = np.ascontiguousarray(triangles.reshape(-1))
        data = _umbel.meshopt_encode_index(flat, vertices)
        size, kind = (2, _USHORT) if vertices <= 0xFFFF else (4, _UINT)
        view = self._stream(data, len(flat), size, "TRIANGLES")
        entry = {"bufferView": view, "componentType": kind, "count": len(flat), "type": "SCALAR"}
        self.accessors.append(entry)
        return len(self.accessors) - 1

    def mesh(self, surface: Quantized, material: Any) -> list[Json]:
        """Primitives, one a material; `material` gives the number of one in the file for a mesh
        with so many sets of texture coordinates."""
        surface = surface if surface.is_ordered else ordered(surface)
        count = len(surface.rows["POSITION"])
        attributes = {name: self.attribute(name, rows) for name, rows in surface.rows.items()}
        sets = sum(name.startswith("TEXCOORD") for name in surface.rows)
        primitives: list[Json] = []
        for number, triangles in _by_material(surface):
            entry: Json = {"attributes": attributes, "indices": self.indices(triangles, count)}
            if number is not None:
                entry["material"] = material(number, sets)
            primitives.append(entry)
        return primitives


def quantized(piece: Piece, low: Doubles, step: float) -> Quantized | None:
    """The piece on the grid of a cell: equal vertices are one, and triangles with two equal corners
    are left out. None if nothing is left."""
    rows: dict[str, NDArray[Any]] = {}
    points = np.rint((piece.points - low) / step)
    rows["POSITION"] = np.clip(points, 0, 0xFFFF).astype(np.uint16)
    for name, values in piece.columns.items():
        rows[name] = _stored(name, values)
    records = np.concatenate(
        [np.ascontiguousarray(r).view(np.uint8) for r in rows.values()], axis=1
    )
    keys = np.ascontiguousarray(records).view(np.dtype((np.void, records.shape[1]))).reshape(-1)
    used = np.unique(piece.triangles)
    _, first, number = np.unique(keys[used], return_index=True, return_inverse=True)
    remap = np.zeros(len(points), np.uint32)
    remap[used] = number.reshape(-1)
    triangles = remap[piece.triangles]
    a, b, c = triangles.T
    good = (a != b) & (b != c) & (c != a)
    if not good.any():
        return None
    materials = None if piece.materials is None else piece.materials[good]
    kept = {name: np.ascontiguousarray(r[used][first]) for name, r in rows.items()}
    return Quantized(kept, triangles[good], materials)


def _stored(name: str, values: Doubles) -> NDArray[Any]:
    """An attribute as it is stored; directions as floats, which a filter rounds later."""
    if name in DIRECTIONS:
        out = np.nan_to_num(values)
        length = np.linalg.norm(out[:, :3], axis=1, keepdims=True)
        out[:, :3] = np.where(length > 0, out[:, :3] / np.where(length > 0, length, 1), (0, 0, 1))
        if name == "TANGENT":
            out[:, 3] = np.where(out[:, 3] < 0, -1, 1)
        return out.astype(np.float32) + np.float32(0)
    inside = np.nan_to_num(values)
    if name == "COLOR_0" or (inside.min(initial=0) >= 0 and inside.max(initial=0) <= 1):
        return np.rint(np.clip(inside, 0, 1) * 0xFFFF).astype(np.uint16)
    return (np.rint(inside * _UV_STEPS) / _UV_STEPS).astype(np.float32) + np.float32(0)


def ordered(surface: Quantized) -> Quantized:
    """In the order that compresses best: triangles by material and for the vertex cache, vertices
    as triangles need them first."""
    count = len(surface.rows["POSITION"])
    parts, numbers = [], []
    for number, triangles in _by_material(surface):
        # Of its own vertices: all of them for each of many materials would take a square of time.
        own, inside = np.unique(triangles, return_inverse=True)
        corners = inside.reshape(-1).astype(np.uint32)
        order, old = _umbel.meshopt_reorder(corners, len(own))
        parts.append(own[old[order]])
        numbers.append(np.full(len(triangles), 0 if number is None else number, np.uint32))
    flat = np.concatenate(parts)
    used, first = np.unique(flat, return_index=True)
    rank = np.argsort(first)
    remap = np.zeros(count, np.uint32)
    remap[used[rank]] = np.arange(len(used), dtype=np.uint32)
    rows = {name: np.ascontiguousarray(r[used[rank]]) for name, r in surface.rows.items()}
    materials = None if surface.materials is None else np.concatenate(numbers)
    return Quantized(rows, remap[flat].reshape(-1, 3), materials, is_ordered=True)


def _by_material(surface: Quantized) -> list[tuple[int | None, Indices]]:
    if surface.materials is None:
        return [(None, surface.triangles)]
    order = np.argsort(surface.materials, kind="stable")
    numbers, starts = np.unique(surface.materials[order], return_index=True)
    parts = np.split(surface.triangles[order], starts[1:])
    return list(zip(numbers.tolist(), parts, strict=True))
