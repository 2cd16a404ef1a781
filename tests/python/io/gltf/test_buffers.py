"""Accessors, where their bytes are, and what is wrong with containers and buffers."""

from __future__ import annotations

import base64
import gzip
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.gltf_builder import INDICES, GltfBuilder, one, read
from helpers.mesh_files import (
    TETRA_POSITIONS,
    TETRA_TRIANGLES,
    corners,
)
from helpers.refusals import refused
from umbel.errors import Error, LoadWarning


def test_interleaved_vertices(tmp_path: Path) -> None:
    table = np.zeros(4, [("p", "<f4", 3), ("n", "i1", 4), ("uv", "<u2", 2)])
    table["p"] = TETRA_POSITIONS
    table["n"] = [[127, 0, 0, 9], [0, -128, 0, 9], [0, 0, -127, 9], [90, 0, 90, 9]]
    table["uv"] = [[0, 65535], [65535, 0], [32768, 1], [2, 3]]
    b = GltfBuilder()
    view = b.view(table.tobytes(), byteStride=table.itemsize)
    common = {"bufferView": view, "count": 4}
    p = b.add("accessors", {**common, "componentType": 5126, "type": "VEC3"})
    n = b.add("accessors", {**common, "componentType": 5120, "type": "VEC3", "byteOffset": 12,
                            "normalized": True})  # fmt: skip
    uv = b.add("accessors", {**common, "componentType": 5123, "type": "VEC2", "byteOffset": 16,
                             "normalized": True})  # fmt: skip
    mesh = read(
        tmp_path,
        one(b.primitive({"POSITION": p, "NORMAL": n, "TEXCOORD_0": uv}, INDICES), builder=b),
    )
    assert np.array_equal(mesh.positions, TETRA_POSITIONS)
    expected = np.float32([[127, 0, 0], [0, -127, 0], [0, 0, -127], [90, 0, 90]]) / np.float32(127)
    assert np.array_equal(mesh.normals, expected)
    assert np.array_equal(mesh.uvs, (table["uv"] / 65535).astype(np.float32))


def test_arrays_that_begin_anywhere_are_one_warning(tmp_path: Path) -> None:
    b = GltfBuilder()
    view = b.view(b"\0\0" + TETRA_POSITIONS.tobytes())
    common = {"bufferView": view, "byteOffset": 2, "componentType": 5126, "type": "VEC3"}
    p, n = (b.add("accessors", {**common, "count": 4}) for _ in range(2))
    primitive = b.primitive({"POSITION": p, "NORMAL": n}, INDICES)
    with pytest.warns(LoadWarning) as caught:
        mesh = read(tmp_path, one(primitive, builder=b))
    assert np.array_equal(mesh.positions, TETRA_POSITIONS)
    assert [str(w.message) for w in caught if "no multiple of 4" not in str(w.message)] == []
    assert len(caught) == 1


@pytest.mark.parametrize(
    ("kind", "scale"), [("i1", 127), ("u1", 255), ("i2", 32767), ("u2", 65535)]
)
def test_quantised_positions_normalised_and_not(tmp_path: Path, kind: str, scale: int) -> None:
    stored = np.array([[0, 1, 2], [100, 3, 4], [5, 120, 6], [7, 8, 127]], kind)
    padded = np.zeros((4, 4), kind)
    padded[:, :3] = stored
    for normalized in (False, True):
        b = GltfBuilder()
        b.root["extensionsRequired"] = b.root["extensionsUsed"] = ["KHR_mesh_quantization"]
        view = b.view(padded.tobytes(), byteStride=padded.itemsize * 4)
        component = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123}[kind]
        p = b.add("accessors", {"bufferView": view, "componentType": component, "count": 4,
                                "type": "VEC3", "normalized": normalized})  # fmt: skip
        mesh = read(tmp_path, one(b.primitive({"POSITION": p}, INDICES), builder=b))
        expected = stored.astype(np.float32) / np.float32(scale if normalized else 1)
        assert np.array_equal(mesh.positions, expected)


@pytest.mark.parametrize("based", [True, False])
def test_sparse_accessors_replace_elements(tmp_path: Path, based: bool) -> None:
    b = GltfBuilder()
    base = b.accessor(TETRA_POSITIONS)
    places, values = np.array([1, 3], np.uint16), np.float32([[9, 8, 7], [6, 5, 4]])
    b.root["accessors"][base]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": b.view(places.tobytes()), "componentType": 5123},
        "values": {"bufferView": b.view(values.tobytes())},
    }
    expected = TETRA_POSITIONS.copy()
    if not based:
        del b.root["accessors"][base]["bufferView"]
        expected[:] = 0
    expected[[1, 3]] = values
    mesh = read(tmp_path, one(b.primitive({"POSITION": base}, INDICES), builder=b))
    assert np.array_equal(mesh.positions, expected)


@pytest.mark.parametrize("says", [True, False])
@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize("kind", ["u1", "u2", "f4"])
def test_colours_of_every_kind(tmp_path: Path, width: int, kind: str, says: bool) -> None:
    largest = {"u1": 255, "u2": 65535, "f4": 1}[kind]
    rng = np.random.default_rng(4)
    values = (rng.random((4, width)) * largest).astype(kind)
    b = GltfBuilder()
    color = b.accessor(values, normalized=says and kind != "f4")
    mesh = read(
        tmp_path,
        one(b.primitive({"POSITION": TETRA_POSITIONS, "COLOR_0": color}, INDICES), builder=b),
    )
    assert mesh.colors.shape == (4, 4)
    assert np.allclose(mesh.colors[:, :width], values / np.float32(largest), rtol=1e-7)
    if width == 3:
        assert (mesh.colors[:, 3] == 1).all()


def test_data_uris_files_beside_and_names_with_spaces(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    (tmp_path / "the data.bin").write_bytes(b.data)
    for text in (b.gltf(), b.gltf("the%20data.bin"), b.gltf("./the data.bin")):
        mesh = read(tmp_path, text, "mesh.gltf")
        assert np.array_equal(corners(mesh), TETRA_POSITIONS[TETRA_TRIANGLES])


def test_buffers_that_begin_as_gzip_does_by_chance(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.view(b"\x1f\x8b\x08\x00")
    b.scene(b.node(mesh=b.tetra()))
    (tmp_path / "data.bin").write_bytes(b.data)
    mesh = read(tmp_path, b.gltf("data.bin"), "mesh.gltf")
    assert np.array_equal(corners(mesh), TETRA_POSITIONS[TETRA_TRIANGLES])
    (tmp_path / "data.bin").write_bytes(gzip.compress(b.data))
    assert len(read(tmp_path, b.gltf("data.bin"), "mesh.gltf").triangles) == 4


@pytest.mark.parametrize("head", ["DATA:;base64,", "data:application/gltf-buffer;BASE64,"])
def test_data_uris_of_any_case(tmp_path: Path, head: str) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    mesh = read(tmp_path, b.gltf(head + base64.b64encode(b.data).decode()), "mesh.gltf")
    assert np.array_equal(corners(mesh), TETRA_POSITIONS[TETRA_TRIANGLES])


def test_content_wins_over_the_extension(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    assert len(read(tmp_path, b.glb(), "mesh.gltf").triangles) == 4
    assert len(read(tmp_path, b.gltf(), "mesh.glb").triangles) == 4
    assert len(read(tmp_path, b.glb(), "mesh.ply").triangles) == 4


def test_zeros_behind_the_json_are_no_part_of_it(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    while b.glb().count(b"}  ") == 0:
        b.root["asset"]["generator"] = b.root["asset"].get("generator", "") + "x"
    data = b.glb()
    end = 20 + int.from_bytes(data[12:16], "little")
    padded = data[:end].rstrip(b" ").ljust(end, b"\0") + data[end:]
    assert len(read(tmp_path, padded).triangles) == 4


def damaged(change: Any) -> GltfBuilder:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    change(b.root)
    return b


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"glTF", "cut short"),
        (damaged(lambda r: None).glb()[:-4], "cut short"),
        (damaged(lambda r: None).glb()[:200], "cut short"),
        (struct.pack("<4sII", b"glTF", 1, 20) + bytes(8), "version 1"),
        (struct.pack("<4sII", b"glTF", 2, 20) + struct.pack("<I4s", 999, b"JSON"), "runs past"),
        (struct.pack("<4sII", b"glTF", 2, 20) + struct.pack("<I4s", 0, b"BIN\0"), "no JSON"),
        (struct.pack("<4sII4s", b"glTF", 2, 24, b"\4\0\0\0") + b"JSON{]}}", "JSON is corrupt"),
        (struct.pack("<4sII4s", b"glTF", 2, 24, b"\4\0\0\0") + b"JSON[1] ", "no object"),
        (b'{"asset":' + b"[" * 100_000, "JSON is corrupt"),
    ],
)
def test_broken_containers_are_named(tmp_path: Path, data: bytes, says: str) -> None:
    with refused(says, "mesh.glb"):
        read(tmp_path, data)


@pytest.mark.parametrize(
    ("uri", "says"),
    [
        ("gone.bin", "gone.bin"),
        ("http://example.com/a.bin", "only files can be read"),
        ("/etc/passwd", "outside the file's folder"),
        ("data:application/octet-stream;base64,AAAA", "should have"),
        ("data:application/octet-stream;base64,A", "damaged data URI"),
    ],
)
def test_buffers_that_cannot_be_had_are_named(tmp_path: Path, uri: str, says: str) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    with pytest.raises(Error, match=says):
        read(tmp_path, b.gltf(uri), "mesh.gltf")
