"""What float32 and grids cost is refused, said, or avoided."""

import warnings

import numpy as np
import pytest

import umbel


def patch(step=1.0, count=50):
    """A patch of a map, its posts `step` metres apart."""
    x, y = np.meshgrid(np.arange(count) * step, np.arange(count) * step)
    points = np.stack([500_000.1 + x, 4_649_776.3 + y, 120 + np.sin(x)], -1).reshape(-1, 3)
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).reshape(-1)
    faces = np.stack([corner, corner + 1, corner + count + 1], 1)
    return points, np.concatenate(
        [faces, np.stack([corner, corner + count + 1, corner + count], 1)]
    )


def test_a_vertex_that_nothing_uses_does_not_move_the_origin():
    points, faces = patch(0.05)
    mesh = umbel.Mesh(np.concatenate([points, [[0.0, 0.0, 0.0]]]), faces)
    assert mesh.origin.any()
    assert np.abs(mesh.world_positions[:-1] - points).max() < 1e-6
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert umbel.build_lod(mesh).report["largest_move"] < 1e-6


def test_parts_too_far_apart_are_said():
    points, faces = patch(10.0)
    far = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    mesh = umbel.Mesh(
        np.concatenate([points, far]),
        np.concatenate([faces, np.array([[0, 1, 2]]) + len(points)]),
    )
    with pytest.warns(umbel.LoadWarning, match="moved vertices by up to 0.2"):
        report = umbel.build_lod(mesh).report
    assert report["largest_move"] > 0.1


def test_ordinary_meshes_are_built_without_a_word():
    points = umbel.shapes.sphere(4).positions.astype(np.float64) / 3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        umbel.build_lod(umbel.Mesh(points, umbel.shapes.sphere(4).triangles))
