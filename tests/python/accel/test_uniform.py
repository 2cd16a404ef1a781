"""The uniform structures, and that every structure answers as the hierarchy does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel

STRUCTURES: list[Callable[..., Any]] = [
    umbel.KdTree,
    umbel.TwoLevelGrid,
    umbel.Octree,
    umbel.IntervalHierarchy,
]


def _points(count: int = 500) -> np.ndarray:
    return np.random.default_rng(2).normal(size=(count, 3)).astype(np.float32)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_queries_are_those_of_the_hierarchy(structure: Callable[..., Any]) -> None:
    mesh = umbel.shapes.blob(4)
    found, bvh = structure(mesh, masks=1 + np.arange(len(mesh.triangles)) % 3), umbel.Bvh(mesh)
    points = _points()
    ways = (np.roll(points, 1, 0) * 0.3 - points).astype(np.float32)
    hits, expected = found.intersect(points, ways), bvh.intersect(points, ways)
    for name in ("t", "primitive", "u", "v"):
        assert np.array_equal(getattr(hits, name), getattr(expected, name)), name
    assert np.array_equal(found.occluded(points, ways), bvh.occluded(points, ways))
    several, same = found.all_hits(points, ways), bvh.all_hits(points, ways)
    assert np.array_equal(several.offsets, same.offsets)
    assert np.array_equal(several.primitive, same.primitive)
    near, nearest = found.closest_point(points), bvh.closest_point(points)
    for name in ("point", "distance", "primitive", "u", "v"):
        assert np.array_equal(getattr(near, name), getattr(nearest, name)), name
    assert np.array_equal(found.contains(points), bvh.contains(points))
    assert np.array_equal(found.signed_distance(points), bvh.signed_distance(points))
    low, high = (-0.5, -0.25, 0), (1, 1, 0.5)
    assert np.array_equal(found.overlaps_box(low, high), bvh.overlaps_box(low, high))
    assert np.array_equal(found.overlaps_sphere(low, 1), bvh.overlaps_sphere(low, 1))
    assert np.array_equal(found.bounds, bvh.bounds) and len(found) == len(bvh)
    planes = [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0)] * 2
    inside = found.overlaps_frustum(planes)
    assert set(inside) <= set(bvh.overlaps_frustum(planes)) and len(inside) > 0
    assert str(len(mesh.triangles)) in repr(found)


def test_statistics_agree_with_each_other() -> None:
    mesh = umbel.shapes.blob(3)
    grid, tree = umbel.TwoLevelGrid(mesh, cost=(1, 4)), umbel.IntervalHierarchy(mesh, cost=(1, 4))
    found = tree.statistics()
    assert found["nodes"] == 2 * found["leaves"] - 1
    assert found["references"] == len(mesh.triangles)
    assert tree.sah_cost == pytest.approx(found["inner_visits"] + 4 * found["tests"])
    found = grid.statistics()
    assert found["references"] >= len(mesh.triangles) and found["empty_leaves"] > 0
    visits = found["inner_visits"] + found["leaf_visits"]
    assert grid.sah_cost == pytest.approx(visits + 4 * found["tests"])
    assert umbel.TwoLevelGrid(mesh, max_references=1).statistics()["references"] == len(grid)


@pytest.mark.parametrize(
    ("structure", "settings"),
    [
        (umbel.TwoLevelGrid, {"density": 20}),
        (umbel.TwoLevelGrid, {"leaf_density": -1}),
        (umbel.TwoLevelGrid, {"max_references": 0}),
        (umbel.TwoLevelGrid, {"density": "fine"}),
        (umbel.IntervalHierarchy, {"max_leaf_size": 0}),
        (umbel.IntervalHierarchy, {"max_leaf_size": "few"}),
        (umbel.IntervalHierarchy, {"invalid": "keep"}),
        (umbel.IntervalHierarchy, {"masks": [1, 2]}),
    ],
)
def test_bad_settings_are_refused(structure: Callable[..., Any], settings: dict[str, Any]) -> None:
    with pytest.raises(umbel.Error):
        structure(umbel.shapes.blob(2), **settings)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_no_triangles_no_answers(structure: Callable[..., Any]) -> None:
    empty = structure(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    assert empty.bounds is None and not empty.occluded([0, 0, 0], [0, 0, 1]).any()
    assert empty.closest_point([[0, 0, 0]]).primitive[0] == -1


@pytest.mark.parametrize("accel", ["kdtree", "grid", "octree", "bih"])
def test_pictures_are_those_of_the_hierarchy(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path, accel: str
) -> None:
    pictures = []
    for name in ("bvh", accel):
        path = tmp_path / f"{name}.png"
        done = umbel_command(
            *("render", blob_ply, "-o", path, "--accel", name, "--json"),
            *("--width", "64", "--height", "48", "--spp", "2"),
        )
        assert done.status == 0 and done.json["accel"] == name
        pictures.append(path.read_bytes())
    # All rays hit the same triangles at the same places, so it is the same picture to the byte.
    assert pictures[0] == pictures[1]
