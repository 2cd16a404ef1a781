"""Mesh and Scene: what they take, what they refuse, and how scenes become meshes."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES, bumpy_sphere
from umbel.errors import Error
from umbel.geometry.mesh import Mesh, area_weighted_normals, to_uint32, unit_normals
from umbel.io import Instance, Scene


def test_meshes_and_pairs_and_lookalikes_are_taken() -> None:
    mesh = Mesh(TETRA_POSITIONS, TETRA_TRIANGLES)
    assert Mesh.from_any(mesh) is mesh
    pair = Mesh.from_any((TETRA_POSITIONS.tolist(), TETRA_TRIANGLES.tolist()))
    look = Mesh.from_any(SimpleNamespace(vertices=TETRA_POSITIONS, faces=TETRA_TRIANGLES))
    for other in (pair, look):
        assert np.array_equal(other.vertices, TETRA_POSITIONS)
        assert np.array_equal(other.faces, TETRA_TRIANGLES)
    assert look.positions is TETRA_POSITIONS  # nothing to convert, nothing copied
    assert look.triangles is TETRA_TRIANGLES


def test_trimesh_gives_what_it_was_given() -> None:
    trimesh = pytest.importorskip("trimesh")
    positions, triangles = bumpy_sphere()
    plain = trimesh.Trimesh(positions, triangles, process=False)
    mesh = Mesh.from_any(plain)
    assert np.array_equal(mesh.positions, positions)
    assert np.array_equal(mesh.triangles, triangles)
    assert mesh.normals is None
    assert mesh.colors is None
    assert mesh.uvs is None
    n = len(positions)
    colors = np.random.default_rng(1).integers(0, 256, (n, 4)).astype(np.uint8)
    normals = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    rich = trimesh.Trimesh(
        positions, triangles, vertex_normals=normals, vertex_colors=colors, process=False
    )
    mesh = Mesh.from_any(rich)
    assert np.allclose(mesh.normals, normals, atol=1e-6)
    assert np.array_equal(mesh.colors, colors / np.float32(255))
    uv = np.random.default_rng(2).random((n, 2))
    textured = trimesh.Trimesh(
        positions, triangles, visual=trimesh.visual.TextureVisuals(uv=uv), process=False
    )
    assert np.allclose(Mesh.from_any(textured).uvs, uv)


def test_arrays_are_made_contiguous_and_of_the_right_type() -> None:
    wide = np.zeros((4, 5))
    wide[:, :3] = TETRA_POSITIONS
    mesh = Mesh(wide[:, :3], TETRA_TRIANGLES.astype(np.int64)[:, ::-1], colors=np.zeros((4, 3)))
    assert mesh.positions.dtype == np.float32
    assert mesh.positions.flags.c_contiguous
    assert mesh.triangles.dtype == np.uint32
    assert mesh.triangles.flags.c_contiguous
    assert mesh.colors.tolist() == [[0, 0, 0, 1]] * 4
    empty = Mesh([], [])
    assert empty.positions.shape == (0, 3)
    assert empty.triangles.shape == (0, 3)
    assert empty.bounds is None


def test_bounds_are_of_used_vertices() -> None:
    points = np.concatenate([TETRA_POSITIONS, [[99, 99, 99]]])
    assert Mesh(points, [[0, 1, 2], [0, 1, 77]]).bounds.tolist() == [[0, 0, 0], [1, 1, 0]]
    assert "5 vertices" in repr(Mesh(points, TETRA_TRIANGLES, name="t"))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (([[0, 0]], [[0, 0, 0]]), r"positions must have shape \(n, 3\), not \(1, 2\)"),
        ((TETRA_POSITIONS, [[0, 1]]), r"triangles must have shape \(m, 3\)"),
        ((TETRA_POSITIONS, [[0, 1, -2]]), r"triangles\[0, 2\] is -2"),
        ((TETRA_POSITIONS, [[0, 1, 2**32]]), "triangles.* is 4294967296"),
        ((TETRA_POSITIONS, [[0.0, 1.0, 2.0]]), "triangles must hold integers"),
        ((["a", "b"], TETRA_TRIANGLES), "positions must hold numbers"),
        (([[0, 0, 0], [0]], TETRA_TRIANGLES), "positions cannot be made an array"),
    ],
)
def test_wrong_arrays_are_named(arguments: Any, says: str) -> None:
    with pytest.raises(Error, match=says):
        Mesh.from_any(arguments)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("normals", np.zeros((3, 3))),
        ("tangents", np.zeros((4, 3))),
        ("uvs", np.zeros((4, 3))),
        ("colors", np.zeros((4, 2))),
        ("material_ids", np.zeros(3, int)),
        ("material_ids", np.zeros(4)),
    ],
)
def test_attributes_of_the_wrong_size_are_named(key: str, value: Any) -> None:
    with pytest.raises(Error, match=key):
        Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, **{key: value})


def test_what_is_no_mesh_is_named() -> None:
    with pytest.raises(Error, match="not int"):
        Mesh.from_any(7)


def test_indices_that_are_none_become_one_that_no_mesh_has() -> None:
    given = [
        np.array([-1, 3, 2**40]),
        np.array([-1.0, 3.0, np.nan]),
        np.array([2.5, 3.0, 1e20], np.float32),
    ]
    for values in given:
        assert to_uint32(values).tolist() == [0xFFFFFFFF, 3, 0xFFFFFFFF]
    assert to_uint32(np.array([-1, 3], ">i4")).tolist() == [0xFFFFFFFF, 3]
    assert to_uint32(np.array([1, 3], "i2")).tolist() == [1, 3]


def test_area_weighted_normals_lean_to_the_larger_side() -> None:
    positions = np.float32([[0, 0, 0], [0, 1, 0], [3, 0, 0], [0, 0, 1], [9, 9, 9]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 1, 50]], np.uint32)
    normals = area_weighted_normals(positions, triangles)
    expected = np.array([1, 0, 3]) / np.sqrt(10)
    assert np.allclose(normals[0], expected, atol=1e-6)
    assert np.allclose(normals[3], [1, 0, 0])
    assert normals[4].tolist() == [0, 0, 0]
    tiny = area_weighted_normals(positions * np.float32(1e-30), triangles)
    assert np.allclose(tiny[0], expected, atol=1e-6)


def test_only_normals_of_the_wrong_length_are_changed() -> None:
    given = np.float32([[0, 0, 1.0001], [0, 3, 4], [0, 0, 0], [np.nan, 0, 0], [1e-30, 0, 0]])
    out = unit_normals(given)
    assert np.array_equal(out[[0, 2, 3]], given[[0, 2, 3]], equal_nan=True)
    assert np.allclose(out[[1, 4]], [[0, 0.6, 0.8], [1, 0, 0]])
    assert unit_normals(given[:1]) is not None
    assert np.shares_memory(unit_normals(given[:1]), given)


def test_a_lone_mesh_in_place_is_not_copied() -> None:
    mesh = Mesh(TETRA_POSITIONS, TETRA_TRIANGLES)
    flat = Scene([mesh], [], [Instance(0)]).flatten()
    assert flat.positions is mesh.positions
    assert flat.triangles is mesh.triangles


def test_flattening_places_and_numbers_every_instance() -> None:
    mesh = Mesh(TETRA_POSITIONS, TETRA_TRIANGLES)
    move = np.eye(4)
    move[:3, 3] = [5, 0, 0]
    flat = Scene([mesh, mesh], [], [Instance(0), Instance(1, move), Instance(0, move @ move)])
    whole = flat.flatten()
    assert np.array_equal(
        whole.positions,
        np.concatenate([TETRA_POSITIONS + np.array([5 * k, 0, 0]) for k in range(3)]),
    )
    assert np.array_equal(
        whole.triangles, np.concatenate([TETRA_TRIANGLES + 4 * k for k in range(3)])
    )
    assert Mesh.from_any(flat).triangles.shape == (12, 3)


def test_flat_scales_keep_what_normals_can_be_kept() -> None:
    positions, triangles = bumpy_sphere()
    normals = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    flat = np.diag([1.0, 1.0, 0.0, 1.0])
    mesh = Scene([Mesh(positions, triangles, normals=normals)], [], [Instance(0, flat)]).flatten()
    assert (np.abs(mesh.normals[:, 2]) == 1).all()
    assert np.isfinite(mesh.normals).all()


def test_too_many_vertices_for_indices_are_refused_before_they_are_made() -> None:
    mesh = Mesh(np.zeros((1_000_000, 3), np.float32), TETRA_TRIANGLES)
    with pytest.raises(Error, match="32-bit indices"):
        Scene([mesh], [], [Instance(0)] * 5000).flatten()


def test_heavy_libraries_wait_until_they_are_needed() -> None:
    code = (
        "import sys, umbel, umbel.io\n"
        "assert not {'trimesh', 'DracoPy', 'umbel.io.gltf.reader'} & set(sys.modules), sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
