"""What float32 and grids cost is refused, said, or avoided."""

import warnings

import numpy as np
import pytest

import umbel
import umbel.io


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


@pytest.mark.parametrize("precision", ["16bits", "0.1mm", 0.25, None])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("instances", ["on", "off"])
def test_what_is_not_finite_is_named_on_any_grid(precision, bad, instances):
    points, faces = patch(0.05, 6)
    points[7, 1] = bad
    mesh = umbel.Mesh(points.astype(np.float32), faces)
    moved = umbel.io.Instance(0, np.diag([2.0, 2.0, 2.0, 1.0]))
    scene = umbel.io.Scene([mesh], [], [umbel.io.Instance(0), moved])
    with pytest.raises(umbel.Error, match="not finite"):
        umbel.build_lod(mesh, precision=precision)
    with pytest.raises(umbel.Error, match="finite"):
        umbel.build_scene(scene, instances=instances, precision=precision)


@pytest.mark.parametrize("precision", ["16bits", "0.1mm", None])
def test_a_vertex_that_is_not_there_is_named_on_any_grid(precision):
    points, faces = patch(0.05, 6)
    faces[3, 1] = 999
    with pytest.raises(umbel.Error, match="vertex index 999 is out of range"):
        umbel.build_lod((points, faces.astype(np.uint32)), precision=precision)
