"""Structures far from zero: rays, distances and overlaps in the world."""

import numpy as np
import pytest

import umbel
from helpers.far_away import UTM, moved, on_grid, patch, xyz

STRUCTURES = [umbel.Bvh, umbel.KdTree, umbel.TwoLevelGrid, umbel.IntervalHierarchy]


def nearest_hits(points, faces, origins, directions):
    """t of the nearest hit of each ray in doubles (Moeller & Trumbore 1997), or infinity."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    out = np.full(len(origins), np.inf)
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        with np.errstate(all="ignore"):
            p = np.cross(d, c - a)
            inverse = 1 / np.einsum("ij,ij->i", b - a, p)
            s = o - a
            u = np.einsum("ij,ij->i", s, p) * inverse
            q = np.cross(s, b - a)
            v = (q @ d) * inverse
            t = np.einsum("ij,ij->i", c - a, q) * inverse
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
        out[i] = t[hit].min(initial=np.inf)
    return out


@pytest.mark.parametrize("structure", STRUCTURES)
def test_rays_hit_where_doubles_say(structure):
    points, faces = patch(30)
    rng = np.random.default_rng(2)
    size = np.ptp(points, axis=0).max()
    targets = points.min(axis=0) + rng.random((200, 3)) * np.ptp(points, axis=0)
    origins = targets + rng.normal(size=(200, 3)) * size
    directions = targets - origins
    truth = nearest_hits(points, faces, origins, directions)
    found = structure(points, faces).intersect(origins, directions)
    assert np.isfinite(truth).any()
    assert (np.isfinite(found.t) != np.isfinite(truth)).sum() <= 1
    both = np.isfinite(truth) & np.isfinite(found.t)
    np.testing.assert_allclose(found.t[both], truth[both], atol=1e-4)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_distances_and_overlaps_are_in_the_world(structure):
    near = on_grid(umbel.shapes.sphere(3))
    here, there = structure(near), structure(moved(near, UTM))
    rng = np.random.default_rng(3)
    points = np.round(rng.normal(size=(100, 3)) * 4096) / 4096
    a, b = here.closest_point(points), there.closest_point(points + UTM)
    assert b.point.dtype == np.float64
    np.testing.assert_allclose(b.point - UTM, a.point, atol=2e-6)
    np.testing.assert_allclose(b.distance, a.distance, atol=2e-6)
    np.testing.assert_array_equal(there.contains(points + UTM), here.contains(points))
    np.testing.assert_allclose(
        there.signed_distance(points + UTM), here.signed_distance(points), atol=2e-6
    )
    np.testing.assert_allclose(there.bounds, here.bounds + UTM, atol=1e-6)
    low, high = np.array([0.1, 0.2, 0.3]), np.array([0.9, 0.8, 0.7])
    np.testing.assert_array_equal(
        there.overlaps_box(low + UTM, high + UTM), here.overlaps_box(low, high)
    )
    np.testing.assert_array_equal(
        there.overlaps_sphere(low + UTM, 0.9), here.overlaps_sphere(low, 0.9)
    )
    planes = umbel.Camera([0, 0, 3], [0, 0, 0]).planes(1.0, far=10.0)
    away = umbel.Camera(UTM + xyz(0, 0, 3), UTM).planes(1.0, far=10.0)
    np.testing.assert_array_equal(there.overlaps_frustum(away), here.overlaps_frustum(planes))


def test_a_hierarchy_follows_moved_vertices_in_the_world():
    points, faces = patch(20)
    bvh = umbel.Bvh(points, faces)
    bvh.refit(points + xyz(0.0, 0.0, 2.0))
    np.testing.assert_allclose(
        bvh.bounds[:, 2], points[:, 2].min() + 2 + np.array([0, np.ptp(points[:, 2])])
    )


def test_files_of_hierarchies_say_that_they_hold_no_origin(tmp_path):
    points, faces = patch(20)
    for structure, name in ((umbel.Bvh, "a.umbvh"), (umbel.KdTree, "a.umkd")):
        made = structure(points, faces)
        with pytest.warns(UserWarning, match="does not hold the origin"):
            made.save(tmp_path / name)
        again = structure.load(tmp_path / name, origin=made.origin)
        np.testing.assert_array_equal(again.bounds, made.bounds)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_moving_the_mesh_moves_no_structure(structure):
    mesh = moved(on_grid(umbel.shapes.sphere(2)), UTM)
    made = structure(mesh)
    before = made.bounds
    mesh.origin += 1000
    np.testing.assert_array_equal(made.bounds, before)
