"""Collisions: pairs of triangles of two meshes, against separating axes in exact fractions."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import umbel


def _meet(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(k,) whether pairs of proper triangles, (k, 3, 3) whole numbers, have a point in common: by
    separating axes, in whole numbers."""
    p, q = first.astype(np.int64), second.astype(np.int64)
    e, f = np.roll(p, -1, 1) - p, np.roll(q, -1, 1) - q
    n, m = np.cross(e[:, 0], e[:, 1]), np.cross(f[:, 0], f[:, 1])
    axes = [n, m, *(np.cross(e[:, i], f[:, k]) for i, k in product(range(3), range(3)))]
    axes += [np.cross(n, e[:, i]) for i in range(3)] + [np.cross(m, f[:, i]) for i in range(3)]
    apart = np.zeros(len(p), bool)
    for axis in axes:
        a, b = (np.einsum("kij,kj->ki", t, axis) for t in (p, q))
        apart |= (a.max(1) < b.min(1)) | (b.max(1) < a.min(1))
    return ~apart


def _soup(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles whose corners are small whole numbers: many touch, and many share a plane."""
    dice = np.random.default_rng(seed)
    corners = dice.integers(0, 24, (count, 1, 3)) + dice.integers(-2, 3, (count, 3, 3))
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = corners[(areas != 0).any(1)]
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * len(corners)).reshape(-1, 3)


@pytest.mark.parametrize("builder", ["quality", "best", "lbvh"])
def test_pairs_are_those_of_separating_axes_in_whole_numbers(builder: str) -> None:
    first, second = _soup(500, 1), _soup(400, 2)
    a, b = umbel.Bvh(*first, builder=builder), umbel.Bvh(*second, width=4)
    p, q = first[0].reshape(-1, 3, 3), second[0].reshape(-1, 3, 3)
    i, k = (x.ravel() for x in np.indices((len(p), len(q))))
    meet = _meet(p[i], q[k])
    assert 100 < meet.sum() < len(meet) / 10
    assert np.array_equal(a.collide(b), np.stack([i[meet], k[meet]], axis=1))
    assert a.collides(b) and b.collides(a)
    shift = np.eye(4)
    shift[:3, 3] = 2, -1, 3
    meet = _meet(p[i], q[k] + shift[:3, 3])
    for pose in (shift, shift[:3]):
        assert np.array_equal(a.collide(b, pose, threads=1), np.stack([i[meet], k[meet]], axis=1))
    shift[0, 3] = 100
    assert not a.collides(b, shift) and a.collide(b, shift).shape == (0, 2)


def test_origins_are_part_of_where_meshes_stand() -> None:
    ball = umbel.shapes.sphere(2)
    far = np.array([4e6, -5e6, 3e6])
    here, there = (
        umbel.Bvh(np.asarray(ball.positions, np.float64) + far + shift, ball.triangles)
        for shift in ([0, 0, 0], [1.5, 0, 0])
    )
    near = umbel.Bvh(ball.positions + np.float32([1.5, 0, 0]), ball.triangles)
    expected = umbel.Bvh(ball).collide(near)
    assert len(expected) > 0
    assert abs(len(here.collide(there)) - len(expected)) <= 0.2 * len(expected)
    assert not umbel.Bvh(ball).collides(here)


def test_what_is_no_transform_is_refused() -> None:
    bvh = umbel.Bvh(umbel.shapes.sphere(1))
    for wrong in (np.eye(3), np.zeros((4, 4)), np.full((3, 4), np.inf), 1e300 * np.eye(3, 4)):
        with pytest.raises(umbel.Error, match="transform"):
            bvh.collide(bvh, wrong)


def test_what_is_no_hierarchy_or_holds_no_numbers_is_refused() -> None:
    bvh = umbel.Bvh(umbel.shapes.sphere(1))
    for other in (3, None, umbel.KdTree(umbel.shapes.sphere(1))):
        for query in (bvh.collide, bvh.collides):
            with pytest.raises(umbel.Error, match=r"^other must be a Bvh"):
                query(other)  # type: ignore[arg-type, operator]
    for wrong in ("x", [["a"] * 4] * 4, [[1, 2], [1]], [[1j] * 4] * 3):
        with pytest.raises(umbel.Error, match=r"^transform must"):
            bvh.collide(bvh, wrong)  # type: ignore[arg-type]
    assert bvh.collides(bvh, np.eye(4, dtype=int))
