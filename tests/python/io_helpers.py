"""Small writers of mesh files, in the plainest way, to check the readers against."""

from __future__ import annotations

import base64
import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np

DATA = Path(os.environ.get("UMBEL_DATA") or Path(__file__).parents[3] / "shared" / "data")

# A tetrahedron, wound to face outwards.
TETRA_POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
TETRA_TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint32)


def signed_volume(mesh: Any) -> float:
    """Positive if the triangles of a closed mesh face outwards."""
    p = mesh.positions.astype(np.float64)[mesh.triangles]
    return float(np.einsum("ni,ni->n", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


def corners(mesh: Any) -> np.ndarray:
    """(m, 3, 3) the triangles' positions, whatever the numbering of vertices."""
    return mesh.positions[mesh.triangles]


def bumpy_sphere(n: int = 12, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Positions and triangles of a closed lumpy ball."""
    rng = np.random.default_rng(seed)
    theta = np.linspace(0, np.pi, n + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)
    ring = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), np.ones_like(phi)),
        ],
        axis=2,
    ).reshape(-1, 3)
    points = np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]) * (
        1 + 0.1 * rng.random((len(ring) + 2, 1))
    )
    rows, columns = n - 1, 2 * n
    faces = []
    for r in range(rows - 1):
        for c in range(columns):
            a, b = r * columns + c, r * columns + (c + 1) % columns
            faces += [[a, a + columns, b], [b, a + columns, b + columns]]
    top, bottom = rows * columns, rows * columns + 1
    for c in range(columns):
        d = (c + 1) % columns
        faces.append([top, c, d])
        faces.append([bottom, (rows - 1) * columns + d, (rows - 1) * columns + c])
    return points.astype(np.float32), np.array(faces, np.uint32)


# --- PLY --------------------------------------------------------------------------------------

_PLY_FORMATS = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I",
    "float": "f", "double": "d", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip


def ply_bytes(
    elements: list[tuple[str, list[tuple[str, ...]], list[tuple[Any, ...]]]],
    fmt: str = "binary_little_endian",
    newline: str = "\n",
) -> bytes:
    """A PLY file of elements (name, properties, rows). A property is (type, name) or
    ("list", count type, type, name); a row has one entry a property, lists as sequences."""
    head = ["ply", f"format {fmt} 1.0", "comment made for a test"]
    for name, properties, rows in elements:
        head.append(f"element {name} {len(rows)}")
        head += ["property " + " ".join(p) for p in properties]
    out = (newline.join(head) + newline + "end_header" + newline).encode()
    order = ">" if fmt == "binary_big_endian" else "<"
    for _, properties, rows in elements:
        for row in rows:
            words: list[str] = []
            for p, value in zip(properties, row, strict=True):
                values = list(value) if p[0] == "list" else [value]
                if fmt == "ascii":
                    words += [str(len(values))] if p[0] == "list" else []
                    words += [_ascii_number(v, p[-2]) for v in values]
                else:
                    if p[0] == "list":
                        out += struct.pack(order + _PLY_FORMATS[p[1]], len(values))
                    out += struct.pack(f"{order}{len(values)}{_PLY_FORMATS[p[-2]]}", *values)
            if fmt == "ascii":
                out += (" ".join(words) + newline).encode()
    return out


def _ascii_number(value: Any, kind: str) -> str:
    return repr(float(value)) if _PLY_FORMATS[kind] in "fd" else str(int(value))


# --- glTF -------------------------------------------------------------------------------------

_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class GltfBuilder:
    """Puts a glTF asset together piece by piece; every method gives the index of what it made."""

    def __init__(self) -> None:
        self.root: dict[str, Any] = {"asset": {"version": "2.0"}}
        self.data = bytearray()

    def add(self, table: str, entry: dict[str, Any]) -> int:
        self.root.setdefault(table, []).append(entry)
        return len(self.root[table]) - 1

    def view(self, raw: bytes, **extra: Any) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        offset = len(self.data)
        self.data += raw
        return self.add(
            "bufferViews", {"buffer": 0, "byteOffset": offset, "byteLength": len(raw), **extra}
        )

    def meshopt_view(
        self, raw: bytes, count: int, stride: int, mode: str, extension: str, filter_: str = ""
    ) -> int:
        """A view whose real data is meshopt-compressed, with a fallback buffer that has none."""
        packed = self.view(raw)
        source = self.root["bufferViews"].pop(packed)
        entry = {**source, "byteStride": stride, "count": count, "mode": mode}
        if filter_:
            entry["filter"] = filter_
        return self.add(
            "bufferViews",
            {
                "buffer": 1,
                "byteLength": count * stride,
                **({"byteStride": stride} if mode == "ATTRIBUTES" else {}),
                "extensions": {extension: entry},
            },
        )

    def accessor(self, array: Any, **extra: Any) -> int:
        array = np.asarray(array)
        width = 1 if array.ndim == 1 else int(np.prod(array.shape[1:]))
        return self.add(
            "accessors",
            {
                "bufferView": self.view(array.tobytes()),
                "componentType": _COMPONENTS[array.dtype.str[1:]],
                "count": len(array),
                "type": _TYPES[width],
                **extra,
            },
        )

    def primitive(self, attributes: dict[str, Any], indices: Any = None, **extra: Any) -> dict:
        entry: dict[str, Any] = {
            "attributes": {
                k: v if isinstance(v, int) else self.accessor(v) for k, v in attributes.items()
            },
            **extra,
        }
        if indices is not None:
            entry["indices"] = indices if isinstance(indices, int) else self.accessor(indices)
        return entry

    def mesh(self, *primitives: dict[str, Any], **extra: Any) -> int:
        return self.add("meshes", {"primitives": list(primitives), **extra})

    def node(self, **entry: Any) -> int:
        return self.add("nodes", entry)

    def scene(self, *nodes: int) -> int:
        return self.add("scenes", {"nodes": list(nodes)})

    def tetra(self, **extra: Any) -> int:
        """A mesh of one tetrahedron."""
        return self.mesh(
            self.primitive(
                {"POSITION": TETRA_POSITIONS}, TETRA_TRIANGLES.astype(np.uint16).reshape(-1)
            ),
            **extra,
        )

    def glb(self) -> bytes:
        root = {**self.root}
        if self.data:
            root["buffers"] = [{"byteLength": len(self.data)}, *self.root.get("buffers", [])]
        text = json.dumps(root).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if data:
            chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def gltf(self, uri: str = "") -> bytes:
        """A .gltf whose buffer is at `uri`, or inside."""
        inside = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        buffers = [{"byteLength": len(self.data), "uri": uri or inside}]
        return json.dumps({**self.root, "buffers": buffers}).encode()
