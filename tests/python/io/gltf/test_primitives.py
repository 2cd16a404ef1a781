"""Primitives and their attributes become triangles and vertices."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.gltf_builder import INDICES, GltfBuilder, one, read
from helpers.mesh_files import (
    TETRA_POSITIONS,
    TETRA_TRIANGLES,
    corners,
)
from umbel.errors import LoadWarning


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_triangles_of_every_index_type(tmp_path: Path, kind: Any) -> None:
    b = GltfBuilder()
    one(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES.astype(kind)), builder=b)
    mesh = read(tmp_path, b)
    assert np.array_equal(mesh.positions, TETRA_POSITIONS)
    assert np.array_equal(mesh.triangles, TETRA_TRIANGLES)
    assert mesh.material_ids is None


@pytest.mark.parametrize("indexed", [True, False])
def test_strips_and_fans_make_the_triangles_that_the_specification_says(
    tmp_path: Path, indexed: bool
) -> None:
    points = np.random.default_rng(1).random((7, 3)).astype(np.float32)
    order = np.array([3, 1, 4, 0, 5, 2, 6], np.uint8) if indexed else np.arange(7)
    for mode in (4, 5, 6):
        b = GltfBuilder()
        indices = order.astype(np.uint8) if indexed else None
        one(b.primitive({"POSITION": points}, indices, mode=mode), builder=b)
        if mode == 4:
            with pytest.warns(LoadWarning, match="last whole triangle"):
                got = corners(read(tmp_path, b))
            want = [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(2)]
        else:
            got = corners(read(tmp_path, b))
            want = [
                (i, i + 1 + i % 2, i + 2 - i % 2) if mode == 5 else (i + 1, i + 2, 0)
                for i in range(5)
            ]
        assert len(got) == len(want)
        for triangle, places in zip(got, want, strict=True):
            expected = points[order[list(places)]]
            assert any(np.array_equal(np.roll(triangle, k, axis=0), expected) for k in range(3))


def test_points_and_lines_are_left_out_with_a_warning(tmp_path: Path) -> None:
    b = GltfBuilder()
    lines = [b.primitive({"POSITION": TETRA_POSITIONS}, mode=m) for m in (0, 1, 2, 3)]
    one(*lines, b.primitive({"POSITION": TETRA_POSITIONS}, INDICES), builder=b)
    with pytest.warns(LoadWarning, match="4 primitives of points or lines"):
        assert len(read(tmp_path, b).triangles) == 4


def test_primitives_that_share_vertices_share_them_still(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["materials"] = [{"name": "a"}, {"name": "b"}]
    position = b.accessor(TETRA_POSITIONS)
    first = b.primitive({"POSITION": position}, INDICES[:6], material=1)
    other = b.primitive({"POSITION": TETRA_POSITIONS + 5}, INDICES[:3])
    second = b.primitive({"POSITION": position}, INDICES[6:], material=0)
    mesh = read(tmp_path, one(first, other, second, builder=b))
    assert len(mesh.positions) == 8
    assert np.array_equal(mesh.triangles[[0, 1, 3, 4]], TETRA_TRIANGLES)
    assert mesh.material_ids.tolist() == [1, 1, 2, 0, 0]
    assert [m.name for m in mesh.materials] == ["a", "b", "default"]


def test_attributes_that_some_primitives_lack_are_filled_in(tmp_path: Path) -> None:
    b = GltfBuilder()
    n = np.tile(np.float32([[0, 0, 1]]), (4, 1))
    t = np.tile(np.float32([[1, 0, 0, -1]]), (4, 1))
    uv = np.random.default_rng(2).random((4, 2)).astype(np.float32)
    full = {"POSITION": TETRA_POSITIONS, "NORMAL": n, "TANGENT": t, "TEXCOORD_0": uv,
            "COLOR_0": np.full((4, 3), 0.5, np.float32)}  # fmt: skip
    bare = {"POSITION": TETRA_POSITIONS + 3}
    mesh = read(tmp_path, one(b.primitive(full, INDICES), b.primitive(bare, INDICES), builder=b))
    assert np.array_equal(mesh.normals[:4], n)
    assert np.array_equal(mesh.tangents[:4], t)
    assert np.array_equal(mesh.uvs, np.concatenate([uv, np.zeros((4, 2))]))
    assert mesh.colors.tolist() == [[0.5, 0.5, 0.5, 1]] * 4 + [[1, 1, 1, 1]] * 4
    # The corner at the origin sees three right triangles of equal area.
    assert np.allclose(mesh.normals[4], -1 / np.sqrt(3), atol=1e-6)
    assert np.allclose(np.linalg.norm(mesh.tangents[4:, :3], axis=1), 1, atol=1e-6)
    assert np.abs((mesh.tangents[4:, :3] * mesh.normals[4:]).sum(axis=1)).max() < 1e-6


@pytest.mark.parametrize("sets", [[1], [0, 2], [2, 7]])
def test_texture_coordinates_keep_their_sets_where_earlier_ones_are_not_there(
    tmp_path: Path, sets: list[int]
) -> None:
    b = GltfBuilder()
    given = {k: np.random.default_rng(k).random((4, 2)).astype(np.float32) for k in sets}
    attributes = {f"TEXCOORD_{k}": uv for k, uv in given.items()}
    b.root["materials"] = [{"normalTexture": {"index": 0, "texCoord": sets[0]}}]
    b.root["textures"], b.root["images"] = [{"source": 0}], [{"uri": "n.png"}]
    Image.new("RGB", (2, 2), (128, 128, 255)).save(tmp_path / "n.png")
    one(b.primitive({"POSITION": TETRA_POSITIONS, **attributes}, INDICES, material=0), builder=b)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = read(tmp_path, b)
        umbel.save(tmp_path / "out.glb", mesh)
        again = umbel.load(tmp_path / "out.glb")
        umbel.build_lod(mesh).save(tmp_path / "out.umbel")
    zeros = np.zeros((4, 2), np.float32)
    for one_of in (mesh, again):
        assert len(one_of.uv_sets) == sets[-1]
        for k, uv in enumerate([one_of.uvs, *one_of.uv_sets]):
            assert np.array_equal(uv, given.get(k, zeros))
    asset = umbel.Asset(tmp_path / "out.umbel")
    assert len(asset.mesh(asset.cut(level=0)).uv_sets) == sets[-1]
    assert again.materials[0].images["normal"].encoded() == (tmp_path / "n.png").read_bytes()


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        (5, [[0, 1, 2], [2, 1, 3], [3, 4, 5], [5, 4, 6]]),
        (6, [[1, 2, 0], [2, 3, 0], [4, 5, 3], [5, 6, 3]]),
    ],
)
def test_strips_and_fans_begin_anew_after_the_largest_index(
    tmp_path: Path, kind: Any, mode: int, expected: list[list[int]]
) -> None:
    b = GltfBuilder()
    p = np.random.default_rng(1).random((7, 3)).astype(np.float32)
    end = np.iinfo(kind).max
    indices = np.array([end, 0, 1, 2, 3, end, 5, 6, end, end, 3, 4, 5, 6, end], kind)
    mesh = read(tmp_path, one(b.primitive({"POSITION": p}, indices, mode=mode), builder=b))
    assert mesh.triangles.tolist() == expected


def test_the_largest_index_may_be_a_vertex(tmp_path: Path) -> None:
    b = GltfBuilder()
    p = np.random.default_rng(1).random((256, 3)).astype(np.float32)
    strip = b.primitive({"POSITION": p}, np.array([0, 1, 255, 2], np.uint8), mode=5)
    assert read(tmp_path, one(strip, builder=b)).triangles.tolist() == [[0, 1, 255], [255, 1, 2]]


def test_indices_beyond_the_vertices_pass_for_validation_to_find(tmp_path: Path) -> None:
    b = GltfBuilder()
    wrong = INDICES.copy()
    wrong[4] = 60000
    good = b.primitive({"POSITION": TETRA_POSITIONS}, INDICES)
    bad = b.primitive({"POSITION": TETRA_POSITIONS}, wrong)
    b.scene(b.node(mesh=b.mesh(bad, good), scale=[-1, 1, 1]), b.node(mesh=b.tetra()))
    mesh = read(tmp_path, b)
    outside = (mesh.triangles >= len(mesh.positions)).any(axis=1)
    assert outside.tolist() == [False, True] + [False] * 10
