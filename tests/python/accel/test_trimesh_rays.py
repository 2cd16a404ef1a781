"""Umbel as `mesh.ray`: trimesh's own calls, beside its pure Python rays and beside Embree."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from trimesh.ray.ray_triangle import RayMeshIntersector as PythonRays

import umbel

pytest.importorskip("rtree")


def _with_rays(mesh: trimesh.Trimesh, **options: Any) -> trimesh.Trimesh:
    mesh.ray = umbel.trimesh_rays(mesh, **options)
    return mesh


def _bumpy() -> trimesh.Trimesh:
    """A closed mesh with hollows, so that rays pass it several times."""
    mesh = umbel.shapes.blob(3)
    return trimesh.Trimesh(mesh.positions.astype(np.float64), mesh.triangles, process=False)


def _rays(count: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    random = np.random.default_rng(seed)
    origins = random.uniform(-2, 2, (count, 3))
    return origins, random.uniform(-0.7, 0.7, (count, 3)) - origins


def _sorted(
    locations: NDArray[np.float64], index_ray: NDArray[np.int64], origins: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Locations by ray, and by distance along it."""
    distance = np.linalg.norm(locations - origins[index_ray], axis=1)
    return locations[np.lexsort((distance, index_ray))]


@pytest.fixture(scope="module", params=["ours", "torus"])
def meshes(request: pytest.FixtureRequest) -> tuple[trimesh.Trimesh, PythonRays]:
    mesh = _bumpy() if request.param == "ours" else trimesh.creation.torus(1.0, 0.3)
    return _with_rays(mesh), PythonRays(mesh)


def test_the_documented_example() -> None:
    mesh = _with_rays(trimesh.creation.icosphere())
    ray_origins = np.array([[0, 0, -5], [2, 2, -10]])
    ray_directions = np.array([[0, 0, 1], [0, 0, 1]])
    locations, index_ray, index_tri = mesh.ray.intersects_location(
        ray_origins=ray_origins, ray_directions=ray_directions
    )
    assert locations.shape == (2, 3) and locations.dtype == np.float64
    assert np.allclose(locations, [[0, 0, -1], [0, 0, 1]])
    assert index_ray.tolist() == [0, 0] and index_tri.shape == (2,)
    assert mesh.ray.intersects_any(ray_origins, ray_directions).tolist() == [True, False]
    first = mesh.ray.intersects_first(ray_origins, ray_directions)
    assert first[0] == index_tri[0] and first[1] == -1


def test_locations_are_those_of_the_python_rays(meshes: tuple[trimesh.Trimesh, PythonRays]) -> None:
    mesh, python = meshes
    origins, directions = _rays(300, 1)
    locations, index_ray, index_tri = mesh.ray.intersects_location(origins, directions)
    expected, expected_ray, expected_tri = python.intersects_location(origins, directions)
    assert len(locations) > 200 and (np.diff(index_ray) >= 0).all()
    assert np.array_equal(index_ray, np.sort(expected_ray))
    assert np.allclose(locations, _sorted(expected, expected_ray, origins), atol=1e-9)
    assert np.allclose(locations, _sorted(locations, index_ray, origins), atol=0)
    assert np.array_equal(np.sort(index_tri), np.sort(expected_tri))


def test_ids_are_those_of_the_python_rays(meshes: tuple[trimesh.Trimesh, PythonRays]) -> None:
    mesh, python = meshes
    origins, directions = _rays(300, 2)
    index_tri, index_ray = mesh.ray.intersects_id(origins, directions)
    expected_tri, expected_ray = python.intersects_id(origins, directions)
    assert index_tri.dtype == index_ray.dtype == np.int64
    assert set(zip(index_tri, index_ray, strict=True)) == set(
        zip(expected_tri, expected_ray, strict=True)
    )
    three = mesh.ray.intersects_id(origins, directions, return_locations=True)
    assert len(three) == 3 and np.array_equal(three[0], index_tri)


def test_first_any_and_single_hits_agree(meshes: tuple[trimesh.Trimesh, PythonRays]) -> None:
    mesh, python = meshes
    origins, directions = _rays(300, 3)
    first = mesh.ray.intersects_first(origins, directions)
    assert np.array_equal(first, python.intersects_first(origins, directions))
    assert np.array_equal(mesh.ray.intersects_any(origins, directions), first >= 0)
    assert 50 < (first >= 0).sum() < 300
    locations, index_ray, index_tri = mesh.ray.intersects_location(
        origins, directions, multiple_hits=False
    )
    assert np.array_equal(index_ray, np.flatnonzero(first >= 0))
    assert np.array_equal(index_tri, first[index_ray])
    expected = python.intersects_location(origins, directions, multiple_hits=False)
    assert np.allclose(locations, expected[0][np.argsort(expected[1])], atol=1e-9)
    index_tri, index_ray = mesh.ray.intersects_id(origins, directions, multiple_hits=False)
    assert np.array_equal(index_tri, first[index_ray])


def test_most_hits_are_the_nearest(meshes: tuple[trimesh.Trimesh, PythonRays]) -> None:
    mesh, _ = meshes
    origins, directions = _rays(200, 4)
    everything = mesh.ray.intersects_id(origins, directions, return_locations=True)
    counts = np.bincount(everything[1], minlength=200)
    assert counts.max() > 2
    for most in (0, 1, 2):
        found = mesh.ray.intersects_id(origins, directions, max_hits=most, return_locations=True)
        assert np.array_equal(np.bincount(found[1], minlength=200), np.minimum(counts, most))
        starts = np.cumsum(counts) - counts
        kept = (np.arange(len(everything[1])) - starts[everything[1]]) < most
        assert np.array_equal(found[0], everything[0][kept])


def test_points_inside_are_those_of_the_python_rays(
    meshes: tuple[trimesh.Trimesh, PythonRays],
) -> None:
    mesh, python = meshes
    points = np.random.default_rng(5).uniform(-1.2, 1.2, (500, 3))
    inside = mesh.ray.contains_points(points)
    assert inside.dtype == bool and 20 < inside.sum() < 480
    assert np.array_equal(inside, python.contains_points(points))
    assert np.array_equal(mesh.contains(points), inside)


def test_rays_through_vertices_and_edges_count_once() -> None:
    mesh = _with_rays(trimesh.creation.box())
    for _ in range(3):
        origins, directions = np.zeros_like(mesh.vertices), mesh.vertices.view(np.ndarray).copy()
        assert mesh.ray.intersects_any(origins, directions).all()
        locations, index_ray, _ = mesh.ray.intersects_location(origins, directions)
        assert np.array_equal(index_ray, np.arange(len(mesh.vertices)))
        assert np.allclose(locations, mesh.vertices)
        middles = mesh.vertices[mesh.edges_unique].mean(axis=1)
        index_ray = mesh.ray.intersects_location(np.zeros_like(middles), middles)[1]
        assert np.array_equal(index_ray, np.arange(len(middles)))
        # From outside through the middle: in and out.
        index_ray = mesh.ray.intersects_location(3 * directions, -directions)[1]
        assert np.array_equal(np.bincount(index_ray), np.full(len(directions), 2))
        mesh = _with_rays(mesh.subdivide())


def test_rays_and_meshes_of_any_size_and_place() -> None:
    base = _bumpy()
    origins, directions = _rays(200, 6)
    expected = PythonRays(base).intersects_first(origins, directions)
    for scale, offset in ((1e-9, 0.0), (1e9, 0.0), (1.0, 1e5), (1e3, -1e8)):
        mesh = _with_rays(base.copy())
        mesh.apply_scale(scale)
        mesh.apply_translation([offset, -offset, offset / 3])
        moved = origins * scale + np.array([offset, -offset, offset / 3])
        assert np.array_equal(mesh.ray.intersects_first(moved, directions * 1e-6), expected)
    # From so far away that 32 bits could not tell where the ray goes.
    mesh = _with_rays(base.copy())
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    far = origins - 1e6 * unit
    assert np.array_equal(
        mesh.ray.intersects_location(far, unit)[2],
        mesh.ray.intersects_location(origins - 4 * unit, unit)[2],
    )


def test_nothing_to_hit_or_to_ask() -> None:
    mesh = _with_rays(trimesh.creation.icosphere(subdivisions=1))
    away = (np.array([[0.0, 0, 5], [9, 9, 9]]), np.array([[0.0, 0, 1], [1, 1, 1]]))
    locations, index_ray, index_tri = mesh.ray.intersects_location(*away)
    assert locations.shape == (0, 3) and len(index_ray) == len(index_tri) == 0
    assert not mesh.ray.intersects_any(*away).any()
    assert mesh.ray.intersects_first(*away).tolist() == [-1, -1]
    for none in ([], np.zeros((0, 3))):
        assert len(mesh.ray.intersects_first(none, none)) == 0
        assert mesh.ray.intersects_location(none, none)[0].shape == (0, 3)
    assert not mesh.ray.contains_points(np.zeros((0, 3))).any()
    assert not mesh.ray.intersects_any([[0.0, 0, 0]], [[0.0, 0, 0]]).any()
    empty = _with_rays(trimesh.Trimesh())
    assert not empty.ray.intersects_any([[0.0, 0, 0]], [[0.0, 0, 1]]).any()
    assert empty.ray.intersects_location([[0.0, 0, 0]], [[0.0, 0, 1]])[0].shape == (0, 3)
    assert not empty.ray.contains_points([[0.0, 0, 0]]).any()


def test_mistakes_are_value_errors() -> None:
    mesh = _with_rays(trimesh.creation.box())
    for origins, directions in (
        (np.zeros((2, 3)), np.zeros((3, 3))),
        (np.zeros((2, 2)), np.zeros((2, 2))),
        ([["a", "b", "c"]], [[0, 0, 1]]),
    ):
        with pytest.raises(ValueError):
            mesh.ray.intersects_location(origins, directions)
    with pytest.raises(ValueError, match=r"\(n,3\)"):
        mesh.ray.contains_points([0.0, 0.0, 0.0])


def test_the_mesh_may_change_and_be_copied() -> None:
    mesh = _with_rays(trimesh.creation.box(), builder="sweep", width=4, threads=1)
    ray = (np.array([[0.0, 0, 5]]), np.array([[0.0, 0, -1]]))
    assert np.allclose(mesh.ray.intersects_location(*ray, multiple_hits=False)[0], [[0, 0, 0.5]])
    mesh.apply_translation([0, 0, 1])
    assert np.allclose(mesh.ray.intersects_location(*ray, multiple_hits=False)[0], [[0, 0, 1.5]])
    mesh.update_faces(np.zeros(len(mesh.faces), bool))
    assert not mesh.ray.intersects_any(*ray).any()
    mesh = _with_rays(trimesh.creation.box())
    for twin in (
        copy.copy(mesh.ray),
        copy.deepcopy(mesh.ray),
        pickle.loads(pickle.dumps(mesh.ray)),
    ):
        assert np.allclose(twin.intersects_location(*ray, multiple_hits=False)[0], [[0, 0, 0.5]])


def test_what_trimesh_builds_on_rays_works() -> None:
    mesh, plain = _with_rays(_bumpy()), _bumpy()
    plain.ray = PythonRays(plain)
    points = np.zeros((20, 3))
    directions = _rays(20, 7)[1]
    assert np.allclose(
        trimesh.proximity.longest_ray(mesh, points, directions),
        trimesh.proximity.longest_ray(plain, points, directions),
    )
    assert mesh.contains(trimesh.sample.volume_mesh(mesh, 100)).all()


def test_embree_agrees() -> None:
    embree = pytest.importorskip("trimesh.ray.ray_pyembree")
    mesh = _bumpy()
    ours, theirs = umbel.trimesh_rays(mesh), embree.RayMeshIntersector(mesh)
    origins, directions = _rays(2000, 8)
    first = ours.intersects_first(origins, directions)
    # Rays that pass an edge closely may meet either of its triangles.
    assert (first == theirs.intersects_first(origins, directions)).mean() > 0.999
    assert np.array_equal(
        ours.intersects_any(origins, directions), theirs.intersects_any(origins, directions)
    )
    assert np.array_equal(ours.contains_points(origins), theirs.contains_points(origins))
    counts = np.bincount(ours.intersects_location(origins, directions)[1], minlength=2000)
    expected = np.bincount(theirs.intersects_location(origins, directions)[1], minlength=2000)
    assert (counts == expected).mean() > 0.999
