"""KHR_draco_mesh_compression."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.gltf_builder import GltfBuilder, one, read
from helpers.mesh_files import (
    bumpy_sphere,
)


@pytest.mark.parametrize("keep_order", [True, False])
def test_draco_gives_the_mesh_that_was_encoded(tmp_path: Path, keep_order: bool) -> None:
    DracoPy = pytest.importorskip("DracoPy")
    positions, triangles = bumpy_sphere()
    normals = (positions / np.linalg.norm(positions, axis=1, keepdims=True)).astype(np.float32)
    uvs = positions[:, :2].astype(np.float64)
    colors = np.random.default_rng(3).integers(0, 256, (len(positions), 4)).astype(np.uint8)
    packed = DracoPy.encode(
        positions, triangles, quantization_bits=16, preserve_order=keep_order,
        normals=normals.astype(np.float64), tex_coord=uvs, colors=colors,
    )  # fmt: skip
    kinds = {a["attribute_type"]: a["unique_id"] for a in DracoPy.decode(packed).attributes}
    ids = {k: kinds[v] for v, k in enumerate(("POSITION", "NORMAL", "COLOR_0", "TEXCOORD_0"))}
    b = GltfBuilder()
    n = len(positions)

    def promised(component: int, kind: str, count: int = n, **extra: Any) -> int:
        entry = {"componentType": component, "type": kind, "count": count, **extra}
        return b.add("accessors", entry)

    primitive = {
        "attributes": {
            "POSITION": promised(5126, "VEC3"),
            "NORMAL": promised(5126, "VEC3"),
            "COLOR_0": promised(5121, "VEC4", normalized=True),
            "TEXCOORD_0": promised(5126, "VEC2"),
        },
        "indices": promised(5125, "SCALAR", triangles.size),
        "extensions": {
            "KHR_draco_mesh_compression": {"bufferView": b.view(packed), "attributes": ids}
        },
    }
    b.root["extensionsUsed"] = b.root["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    mesh = read(tmp_path, one(primitive, builder=b))

    def table(p: Any, nrm: Any, uv: Any, c: Any, t: Any) -> np.ndarray:
        rows = np.concatenate([p, nrm, uv, c], axis=1)[t].reshape(len(t), 3, -1)
        first = np.lexsort(rows[:, :, :3].round(2).transpose(2, 1, 0).reshape(-1, len(t)))
        return rows[first] if not keep_order else rows

    if keep_order:
        got = table(mesh.positions, mesh.normals, mesh.uvs, mesh.colors, mesh.triangles)
        want = table(positions, normals, uvs, colors / 255, triangles)
        assert np.abs(got - want).max() < 1e-3
    assert len(mesh.triangles) == len(triangles)
    # Whatever the order: every vertex is near one of the source with the same colour.
    nearest = ((mesh.positions[:, None] - positions[None]) ** 2).sum(axis=2).argmin(axis=1)
    assert np.abs(mesh.positions - positions[nearest]).max() < 1e-3
    assert np.array_equal((mesh.colors * 255).round(), colors[nearest])
    assert np.abs(mesh.normals - normals[nearest]).max() < 1e-2
    assert np.abs(mesh.uvs - uvs[nearest]).max() < 1e-3
    assert sorted(map(sorted, nearest[mesh.triangles].tolist())) == sorted(
        map(sorted, triangles.tolist())
    )


@pytest.mark.parametrize("mode", [4, 5])
def test_attributes_beside_draco_are_read(tmp_path: Path, mode: int) -> None:
    DracoPy = pytest.importorskip("DracoPy")
    positions, triangles = bumpy_sphere()
    packed = DracoPy.encode(positions, triangles, quantization_bits=16, preserve_order=True)
    n = len(positions)
    colors = np.random.default_rng(5).random((n, 4)).astype(np.float32)
    b = GltfBuilder()
    entry = {"componentType": 5126, "type": "VEC3", "count": n}
    primitive = {
        "attributes": {"POSITION": b.add("accessors", entry), "COLOR_0": b.accessor(colors)},
        "mode": mode,
        "extensions": {
            "KHR_draco_mesh_compression": {
                "bufferView": b.view(packed),
                "attributes": {"POSITION": 0},
            }
        },
    }
    mesh = read(tmp_path, one(primitive, builder=b))
    assert np.array_equal(mesh.colors, colors)
    assert np.array_equal(mesh.triangles, triangles)  # also of a strip: Draco holds triangles
