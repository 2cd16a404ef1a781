"""Checking, repairing, welding and snapping from Python."""

from __future__ import annotations

import numpy as np
import pytest

import umbel
from helpers.meshes import triangle_keys


def broken_sphere() -> umbel.Mesh:
    mesh = umbel.shapes.sphere(2)
    mesh.positions = mesh.positions.copy()
    mesh.positions[5] = np.nan
    return mesh


def test_validate_names_the_first_vertex_at_fault() -> None:
    umbel.validate(umbel.shapes.sphere(2))
    with pytest.raises(umbel.Error, match=r"\b5\b") as raised:
        umbel.validate(broken_sphere())
    assert raised.value.code == "invalid_mesh"
    assert isinstance(raised.value, ValueError)


def test_validate_names_the_index_out_of_range() -> None:
    mesh = umbel.shapes.sphere(1)
    mesh.triangles = mesh.triangles.copy()
    mesh.triangles[7, 1] = 4_000_000
    with pytest.raises(umbel.Error, match=r"7.*4000000|4000000.*7"):
        umbel.validate(mesh)


def test_dropping_leaves_out_exactly_the_invalid() -> None:
    mesh = broken_sphere()
    touched = int((mesh.triangles == 5).any(axis=1).sum())
    kept, dropped = umbel.drop_invalid(mesh)
    assert dropped == touched
    assert len(kept.triangles) == len(mesh.triangles) - touched
    umbel.validate(kept)


def test_welding_joins_a_soup_and_keeps_the_triangles() -> None:
    mesh = umbel.shapes.sphere(3)
    soup = umbel.Mesh(
        mesh.positions[mesh.triangles].reshape(-1, 3),
        np.arange(len(mesh.triangles) * 3).reshape(-1, 3),
    )
    welded = umbel.weld(soup)
    assert len(welded.positions) == len(mesh.positions)
    assert np.array_equal(
        welded.positions[welded.triangles], mesh.positions[mesh.triangles]
    )  # in their order, corner by corner


def test_welding_keeps_seams_of_attributes_and_materials() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    positions = np.vstack([corners, corners])
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    uvs = np.zeros((6, 2), np.float32)
    uvs[3] = 1
    assert len(umbel.weld(umbel.Mesh(positions, triangles)).positions) == 3
    assert len(umbel.weld(umbel.Mesh(positions, triangles, uvs=uvs)).positions) == 4
    two = umbel.Mesh(positions, triangles, material_ids=np.array([0, 1]))
    assert len(umbel.weld(two).positions) == 6


def test_snapping_rounds_to_the_grid() -> None:
    mesh = umbel.shapes.blob(3)
    snapped, moved = umbel.snap(mesh, 2**-6)
    scaled = snapped.positions * 2**6
    assert np.array_equal(scaled, np.round(scaled))
    distance = np.linalg.norm(snapped.positions.astype(float) - mesh.positions, axis=1).max()
    assert moved == pytest.approx(distance, rel=1e-5)
    assert moved <= 2**-6 * np.sqrt(3) / 2 + 1e-9
    assert np.array_equal(snapped.triangles, mesh.triangles)
    for step in (0.0, -1.0, 0.3, float("nan")):
        with pytest.raises(umbel.Error):
            umbel.snap(mesh, step)


def test_a_bad_shape_or_type_is_named() -> None:
    for bad in (object(), 3, None):
        with pytest.raises(umbel.Error, match=type(bad).__name__):
            umbel.cluster_mesh(bad)
    with pytest.raises(umbel.Error, match="shape"):
        umbel.Mesh(np.zeros((3, 2)), [[0, 1, 2]])
    with pytest.raises(umbel.Error):
        umbel.Mesh(np.zeros((3, 3)), [[0, 1, -1]])
    with pytest.raises(umbel.Error, match="step must be a number"):
        umbel.snap(umbel.shapes.sphere(1), "x")


def test_keys_tell_meshes_apart() -> None:
    mesh = umbel.shapes.blob(2)
    turned = umbel.Mesh(mesh.positions, np.roll(mesh.triangles, 1, axis=1)[::-1])
    flipped = umbel.Mesh(mesh.positions, mesh.triangles[:, ::-1])
    missing = umbel.Mesh(mesh.positions, mesh.triangles[1:])
    keys = triangle_keys(mesh)
    assert np.array_equal(keys, triangle_keys(turned))
    assert not np.array_equal(keys, triangle_keys(flipped))
    assert not np.array_equal(keys, triangle_keys(missing))
