"""Damaged files: whatever bytes are flipped or missing, a file loads or raises umbel.Error."""

from __future__ import annotations

import copy
import json
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.gltf_builder import GltfBuilder, meshopt_sphere, skinned
from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES, ply_bytes, stl_bytes
from helpers.meshes import full_mesh
from umbel.errors import Error
from umbel.io import load, save

ROUNDS = 120
XYZ = [("float", "x"), ("float", "y"), ("float", "z")]


def ply(fmt: str) -> bytes:
    polygons = [([0, 1, 2], 1), ([0, 1, 2, 3], 2), ([3, 2, 1], 0)]
    face = [("list", "uchar", "int", "vertex_indices"), ("uchar", "material_index")]
    return ply_bytes(
        [
            ("vertex", XYZ, [tuple(p) for p in TETRA_POSITIONS.tolist()]),
            ("face", face, polygons),
            ("tristrips", [("list", "int", "int", "vertex_indices")], [([0, 1, 2, -1, 3, 2, 1],)]),
        ],
        fmt,
    )


def saved(folder: Path, extension: str) -> bytes:
    path = folder / f"source{extension}"
    save(path, full_mesh())
    return path.read_bytes()


def instanced() -> bytes:
    b = GltfBuilder()
    attributes = {"TRANSLATION": b.accessor(TETRA_POSITIONS)}
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    b.scene(b.node(mesh=b.tetra(), extensions=extensions))
    return b.gltf()


SOURCES: dict[str, Any] = {
    "ascii.ply": lambda folder: ply("ascii"),
    "little.ply": lambda folder: ply("binary_little_endian"),
    "big.ply": lambda folder: ply("binary_big_endian"),
    "full.ply": lambda folder: saved(folder, ".ply"),
    "full.glb": lambda folder: saved(folder, ".glb"),
    "full.obj": lambda folder: saved(folder, ".obj"),
    "ascii.stl": lambda folder: stl_bytes(TETRA_POSITIONS[TETRA_TRIANGLES], "ascii"),
    "binary.stl": lambda folder: stl_bytes(TETRA_POSITIONS[TETRA_TRIANGLES], "binary"),
    "skinned.glb": lambda folder: skinned().glb(),
    "meshopt.glb": lambda folder: meshopt_sphere(),
    "instanced.gltf": lambda folder: instanced(),
}


def damage(data: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(data)
    kind = rng.integers(0, 4)
    if kind == 0:
        return bytes(out[: rng.integers(0, len(out))])
    # Headers are where damage has the strangest effects.
    reach = len(out) if kind == 1 else min(len(out), 600)
    for _ in range(rng.integers(1, 9)):
        at = int(rng.integers(0, reach))
        if kind == 3:
            out[at : at + 1] = bytes(rng.choice(list(b'0123456789-.eE,:{}[]"\n /x'), 2).tolist())
        else:
            out[at] = int(rng.integers(0, 256))
    return bytes(out)


@pytest.mark.parametrize("name", sorted(SOURCES))
def test_damaged_files_load_or_raise_a_sentence(tmp_path: Path, name: str) -> None:
    data = SOURCES[name](tmp_path)
    (tmp_path / name).write_bytes(data)
    assert len(load(tmp_path / name).triangles) > 0
    rng = np.random.default_rng(sum(name.encode()))
    path = tmp_path / f"damaged-{name}"
    loaded = 0
    for _ in range(ROUNDS):
        path.write_bytes(damage(data, rng))
        start = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                mesh = load(path)
            assert mesh.triangles.shape[1:] == (3,)
            assert mesh.normals is None or len(mesh.normals) == len(mesh.positions)
            loaded += 1
        except Error as error:
            assert "damaged" in str(error)
        assert time.perf_counter() - start < 5
    assert loaded < ROUNDS


def paths(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where every value of some JSON is."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    out = []
    for key, child in inner:
        out.append((*at, key))
        if isinstance(child, (dict, list)):
            out += paths(child, (*at, key))
    return out


STRANGE: list[Any] = [
    None, True, -1, 0, 1, 3, 255, 2**31, 2**63, 10**30, 0.5, 1e308, -1e-300, "", "x", "VEC3", [],
    {}, [0], [[0]], {"a": 1}, [1e308] * 3, [None] * 4,
]  # fmt: skip


def glb_of(root: Any, binary: bytes) -> bytes:
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    out = len(text).to_bytes(4, "little") + b"JSON" + text
    out += len(binary).to_bytes(4, "little") + b"BIN\0" + binary
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(out)).to_bytes(4, "little") + out


@pytest.mark.parametrize("name", ["full.glb", "skinned.glb", "meshopt.glb", "sparse.glb"])
def test_strange_json_loads_or_raises_a_sentence(tmp_path: Path, name: str) -> None:
    data = sparse() if name == "sparse.glb" else SOURCES[name](tmp_path)
    size = int.from_bytes(data[12:16], "little")
    root, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
    rng = np.random.default_rng(len(data))
    path = tmp_path / f"damaged-{name}"
    for place in paths(root):
        for _ in range(4):
            changed = copy.deepcopy(root)
            at = changed
            for key in place[:-1]:
                at = at[key]
            choice = int(rng.integers(-1, len(STRANGE)))
            if choice < 0:
                del at[place[-1]]
            else:
                at[place[-1]] = STRANGE[choice]
            path.write_bytes(glb_of(changed, binary))
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    load(path)
            except Error as error:
                assert "damaged" in str(error)


def sparse() -> bytes:
    b = GltfBuilder()
    base = b.accessor(TETRA_POSITIONS)
    b.root["accessors"][base]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": b.view(b"\1\0"), "componentType": 5123, "byteOffset": 0},
        "values": {"bufferView": b.view(np.ones(3, np.float32).tobytes())},
    }
    indices = TETRA_TRIANGLES.astype(np.uint8).reshape(-1)
    primitive = b.primitive({"POSITION": base}, indices, targets=[{"POSITION": base}])
    attributes = {"TRANSLATION": b.accessor(TETRA_POSITIONS)}
    node = b.node(mesh=b.mesh(primitive, weights=[1.0]), translation=[1, 0, 0],
                  extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})  # fmt: skip
    b.root["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1],
                            "baseColorTexture": {"index": 0}}}]  # fmt: skip
    primitive["material"] = 0
    b.scene(b.node(children=[node]))
    return b.glb()
