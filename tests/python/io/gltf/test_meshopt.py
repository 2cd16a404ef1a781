"""EXT_meshopt_compression and KHR_meshopt_compression."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.gltf_builder import GltfBuilder, one, read
from helpers.mesh_files import (
    bumpy_sphere,
    signed_volume,
)
from umbel import _umbel


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("index_kind", [np.uint16, np.uint32])
def test_meshopt_streams_give_the_bytes_that_were_encoded(
    tmp_path: Path, extension: str, index_kind: Any
) -> None:
    positions, triangles = bumpy_sphere()
    n = len(positions)
    quantised = np.zeros((n, 4), np.int16)
    quantised[:, :3] = (positions / 2 * 32767).round()
    packed = _umbel.meshopt_encode_vertex(quantised.view(np.uint8))
    flat = triangles.reshape(-1)
    b = GltfBuilder()
    b.root["buffers"] = [{"byteLength": 1 << 20, "extensions": {extension: {"fallback": True}}}]
    b.root["extensionsUsed"] = b.root["extensionsRequired"] = [extension, "KHR_mesh_quantization"]
    view = b.meshopt_view(packed, n, 8, "ATTRIBUTES", extension)
    position = b.add("accessors", {"bufferView": view, "componentType": 5122, "count": n,
                                   "type": "VEC3", "normalized": True})  # fmt: skip
    size = np.dtype(index_kind).itemsize
    modes = {
        "TRIANGLES": _umbel.meshopt_encode_index(flat, n),
        "INDICES": _umbel.meshopt_encode_index_sequence(flat, n),
    }
    primitives = []
    for mode, stream in modes.items():
        indices = b.add("accessors", {
            "bufferView": b.meshopt_view(stream, len(flat), size, mode, extension),
            "componentType": 5123 if size == 2 else 5125, "count": len(flat), "type": "SCALAR",
        })  # fmt: skip
        primitives.append(b.primitive({"POSITION": position}, indices))
    mesh = read(tmp_path, one(*primitives, builder=b))
    assert np.array_equal(mesh.positions, quantised[:, :3] / np.float32(32767))
    assert np.array_equal(mesh.triangles[len(triangles) :], triangles)  # sequences keep all
    first = mesh.triangles[: len(triangles)]  # lists keep triangles, not their first corner
    assert [sorted(t) for t in first.tolist()] == [sorted(t) for t in triangles.tolist()]
    assert np.isclose(signed_volume(mesh), 2 * signed_volume(type(mesh)(mesh.positions, triangles)))


def test_meshopt_filters_are_undone(tmp_path: Path) -> None:
    positions, triangles = bumpy_sphere()
    n = len(positions)
    unit = np.zeros((n, 4), np.float32)
    unit[:, :3] = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    padded = np.zeros((n, 4), np.float32)
    padded[:, :3] = positions
    rgba = np.random.default_rng(7).random((n, 4)).astype(np.float32)
    b = GltfBuilder()
    b.root["buffers"] = [{"byteLength": 1 << 20}]

    def filtered(values: Any, name: str, stride: int, bits: int, **accessor: Any) -> int:
        stream = _umbel.meshopt_encode_vertex(
            _umbel.meshopt_encode_filter(values, name, stride, bits)
        )
        view = b.meshopt_view(stream, n, stride, "ATTRIBUTES", "KHR_meshopt_compression", name)
        return b.add("accessors", {"bufferView": view, "count": n, **accessor})

    attributes = {
        "POSITION": filtered(padded, "EXPONENTIAL", 16, 23, componentType=5126, type="VEC3"),
        "NORMAL": filtered(unit, "OCTAHEDRAL", 8, 16, componentType=5122, type="VEC3",
                           normalized=True),
        "COLOR_0": filtered(rgba, "COLOR", 8, 15, componentType=5123, type="VEC4",
                            normalized=True),
    }  # fmt: skip
    mesh = read(tmp_path, one(b.primitive(attributes, triangles.reshape(-1)), builder=b))
    assert np.abs(mesh.positions - positions).max() < 1e-6
    assert np.abs(mesh.normals - unit[:, :3]).max() < 1e-3
    assert np.abs(mesh.colors - rgba).max() < 1e-3


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda c, d: c.meshopt_decode_vertex(d, 10**12, 16), "cannot come from"),
        (lambda c, d: c.meshopt_decode_vertex(d, 10, 6), "stride 6"),
        (lambda c, d: c.meshopt_decode_vertex(d[:-3], 256, 16), "corrupt"),
        (lambda c, d: c.meshopt_decode_vertex(b"", 10, 16), "cannot come from"),
        (lambda c, d: c.meshopt_decode_index(d, 10, 4), "no whole triangles"),
        (lambda c, d: c.meshopt_decode_index(d, 9, 3), "index size 3"),
        (lambda c, d: c.meshopt_decode_index(d, 9, 4), "corrupt"),
        (lambda c, d: c.meshopt_decode_index_sequence(d, 9, 4), "corrupt"),
        (lambda c, d: c.meshopt_filter(np.zeros((4, 8), np.uint8), "SEPIA", 8), "'SEPIA'"),
        (lambda c, d: c.meshopt_filter(np.zeros((4, 12), np.uint8), "OCTAHEDRAL", 12), "12"),
        (lambda c, d: c.meshopt_filter(np.zeros((4, 8), np.uint8), "OCTAHEDRAL", 4), "8 bytes"),
    ],
)
def test_meshopt_codecs_reject_what_makes_no_sense(call: Any, says: str) -> None:
    good = _umbel.meshopt_encode_vertex(np.arange(256 * 16, dtype=np.uint8).reshape(256, 16))
    with pytest.raises(ValueError, match=says):
        call(_umbel, good)
