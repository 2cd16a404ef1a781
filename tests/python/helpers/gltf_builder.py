"""glTF files put together piece by piece, in the plainest way, to check the reader against."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES, bumpy_sphere
from umbel import _umbel
from umbel.io import load

INDICES = TETRA_TRIANGLES.astype(np.uint16).reshape(-1)
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


def read(tmp_path: Path, data: bytes | GltfBuilder, name: str = "mesh.glb") -> Any:
    path = tmp_path / name
    path.write_bytes(data.glb() if isinstance(data, GltfBuilder) else data)
    return load(path)


def one(*primitives: Any, builder: GltfBuilder, **mesh: Any) -> GltfBuilder:
    builder.scene(builder.node(mesh=builder.mesh(*primitives, **mesh)))
    return builder


def skinned() -> GltfBuilder:
    """A tetrahedron whose vertex 3 hangs on a joint that has moved up by 5 since binding."""
    b = GltfBuilder()
    joints = np.array([[0, 0, 0, 0]] * 3 + [[1, 0, 0, 0]], np.uint8)
    weights = np.array([[1, 0, 0, 0]] * 4, np.float32)
    inverse = np.stack([np.eye(4), np.eye(4)]).astype(np.float32)
    inverse[1, 3, :3] = [0, 0, -1]  # column-major: bound at z = 1
    mesh = b.mesh(
        b.primitive({"POSITION": TETRA_POSITIONS, "JOINTS_0": joints, "WEIGHTS_0": weights},
                    INDICES)
    )  # fmt: skip
    tip = b.node(translation=[0, 0, 6])
    hip = b.node(translation=[2, 0, 0], children=[tip])
    b.add("skins", {"joints": [hip, tip], "inverseBindMatrices": b.accessor(inverse)})
    b.scene(hip, b.node(mesh=mesh, skin=0, translation=[100, 100, 100]))
    return b


def meshopt_sphere() -> bytes:
    """A .glb whose positions and triangles are streams of EXT_meshopt_compression."""
    positions, triangles = bumpy_sphere(4)
    flat = triangles.reshape(-1)
    b = GltfBuilder()
    b.root["buffers"] = [{"byteLength": 1 << 16}]
    name = "EXT_meshopt_compression"
    padded = np.zeros((len(positions), 4), np.float32)
    padded[:, :3] = positions
    stream = _umbel.meshopt_encode_vertex(padded.view(np.uint8))
    view = b.meshopt_view(stream, len(positions), 16, "ATTRIBUTES", name)
    position = b.add("accessors", {"bufferView": view, "componentType": 5126,
                                   "count": len(positions), "type": "VEC3"})  # fmt: skip
    stream = _umbel.meshopt_encode_index(flat, len(positions))
    view = b.meshopt_view(stream, len(flat), 4, "TRIANGLES", name)
    indices = b.add("accessors", {"bufferView": view, "componentType": 5125,
                                  "count": len(flat), "type": "SCALAR"})  # fmt: skip
    b.scene(b.node(mesh=b.mesh(b.primitive({"POSITION": position}, indices))))
    return b.glb()
