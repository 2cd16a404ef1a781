"""Trees over boxes: kd-trees with the caller's intersection, and trees that change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import umbel
from umbel.bvh import DynamicTree


def _boxes(count: int, seed: int = 1) -> np.ndarray:
    dice = np.random.default_rng(seed)
    low = dice.random((count, 3), np.float32)
    return np.hstack([low, low + 0.05 * dice.random((count, 3), np.float32)])


def _overlapping(boxes: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.flatnonzero(((boxes[:, :3] <= high) & (boxes[:, 3:] >= low)).all(1))


@pytest.mark.parametrize("builder", ["exact", "binned"])
def test_nearest_balls_are_those_of_brute_force(builder: str) -> None:
    dice = np.random.default_rng(3)
    centers = dice.random((300, 3))
    radius = 0.03
    origins = dice.normal(size=(400, 3)) + 0.5
    directions = 0.5 - origins + 0.2 * dice.normal(size=(400, 3))

    def entry(rays: np.ndarray, balls: np.ndarray) -> np.ndarray:
        o, d = origins[rays] - centers[balls], directions[rays]
        dd, od = (d * d).sum(1), (o * d).sum(1)
        root = od**2 - dd * ((o * o).sum(1) - radius**2)
        return np.where(root < 0, np.inf, (-od - np.sqrt(np.maximum(root, 0))) / dd)

    tree = umbel.BoxKdTree(np.hstack([centers - radius, centers + radius]), builder=builder)
    t, ball = tree.intersect(origins, directions, entry)
    rays, balls = (x.ravel() for x in np.indices((400, 300)))
    every = entry(rays, balls).astype(np.float32).reshape(400, 300)
    every[every < 0] = np.inf
    assert np.array_equal(t, every.min(1))
    hit = np.isfinite(t)
    assert 50 < hit.sum() < 400
    assert np.array_equal(ball[hit], every.argmin(1)[hit]) and (ball[~hit] == -1).all()
    assert len(tree.candidates(origins, directions)[1]) < 400 * 300 / 5
    short, _ = tree.intersect(origins, directions, entry, t_max=0.5)
    assert np.array_equal(np.isfinite(short), t <= 0.5)


def test_kd_tree_over_boxes_finds_overlaps_and_shows_its_tables() -> None:
    boxes = _boxes(2000)
    tree = umbel.BoxKdTree(boxes, target_leaf_size=8)
    low, high = np.float32([0.2, 0.3, 0.1]), np.float32([0.4, 0.35, 0.5])
    assert np.array_equal(tree.overlaps_box(low, high), _overlapping(boxes, low, high))
    leaves = (tree.nodes["link"] & 3) == 3
    found = tree.statistics()
    assert found["leaves"] == leaves.sum() and found["nodes"] == len(tree.nodes)
    assert set(tree.references) == set(range(len(boxes))) and len(tree) == 2000
    assert found["leaves"] < umbel.BoxKdTree(boxes).statistics()["leaves"]
    with pytest.raises(umbel.Error):
        umbel.BoxKdTree(boxes[:, ::-1])
    with pytest.raises(umbel.Error):
        umbel.BoxKdTree(boxes, target_leaf_size=256)
    with pytest.raises(umbel.Error):
        tree.intersect([[0, 0, 0]], [[1, 1, 1]], lambda rays, boxes: np.zeros(1 + len(rays)))
    assert umbel.BoxKdTree(np.zeros((0, 6))).bounds is None


@pytest.mark.parametrize(
    ("found", "says"),
    [
        (np.ma.array([1.0], mask=[True]), "what test gives must have no masked values"),
        (np.array([1 + 1j]), "what test gives must hold numbers, not complex128"),
        ([[1.0], [2.0, 3.0]], "what test gives must be an array"),
        (["near"], "what test gives must hold numbers"),
    ],
)
def test_what_the_caller_s_test_gives_must_be_distances(found: Any, says: str) -> None:
    tree = umbel.BoxKdTree([[1, 1, 1, 2, 2, 2]])
    with pytest.raises(umbel.Error, match=says):
        tree.intersect([[0, 0, 0]], [[1, 1, 1]], lambda rays, boxes: found)
    far, _ = tree.intersect([[0, 0, 0]], [[1, 1, 1]], lambda rays, boxes: np.full(1, 1e300))
    assert far.tolist() == [np.inf]


def test_a_dynamic_tree_holds_what_was_put_in_and_not_taken_out() -> None:
    boxes, more = _boxes(500), _boxes(300, 2)
    tree = DynamicTree(boxes)
    new = tree.insert(more)
    assert np.array_equal(new, np.arange(500, 800)) and len(tree) == 800
    tree.remove(np.arange(0, 500, 2))
    tree.move(new[:100], boxes[:100])
    tree.refit([1, 3], more[:2])
    truth = {i: boxes[i] for i in range(1, 500, 2)} | {500 + i: more[i] for i in range(300)}
    truth |= {500 + i: boxes[i] for i in range(100)} | {1: more[0], 3: more[1]}
    numbers = np.array(sorted(truth))
    held = np.array([truth[i] for i in numbers])
    for low in _boxes(20, 3)[:, :3]:
        expected = numbers[_overlapping(held, low, low + np.float32(0.2))]
        assert np.array_equal(tree.overlaps_box(low, low + np.float32(0.2)), expected)
    assert 0 not in tree and 1 in tree and np.array_equal(tree.box(1), more[0])
    assert set(tree.snapshot().primitives) == set(truth)
    tree.rebuild()
    report = tree.quality()
    assert report.sah_cost == report.built_sah_cost and not report.rebuild_advised
    assert set(tree.snapshot().primitives) == set(truth)


def test_a_snapshot_of_triangles_is_traced() -> None:
    mesh = umbel.shapes.blob(3)
    corners = mesh.positions[mesh.triangles]
    tree = DynamicTree()
    tree.insert(np.hstack([corners.min(1), corners.max(1)]))
    bvh, plain = umbel.Bvh.from_tree(tree.snapshot(), mesh), umbel.Bvh(mesh)
    rays = np.full((50, 3), 3.0), np.random.default_rng(1).normal(-3, 0.4, (50, 3))
    assert np.array_equal(bvh.intersect(*rays).t, plain.intersect(*rays).t)


def test_mistakes_leave_a_dynamic_tree_as_it_was() -> None:
    boxes = _boxes(10)
    tree = DynamicTree(boxes)
    for mistake in (
        lambda: tree.remove([3, 10]),
        lambda: tree.remove([3, 3]),
        lambda: tree.remove([3.5]),
        lambda: tree.remove([[1, 2], [3]]),
        lambda: tree.insert([[1, 2], [3]]),
        lambda: tree.insert(np.vstack([boxes[:2], np.full((1, 6), np.nan)])),
        lambda: tree.move([1, 2], boxes[:1]),
        lambda: tree.refit([1], boxes[:1, ::-1]),
        lambda: tree.snapshot(0),
        lambda: tree.box(12),
    ):
        with pytest.raises(umbel.Error):
            mistake()
    assert len(tree) == 10 and all(np.array_equal(tree.box(i), boxes[i]) for i in range(10))


@pytest.mark.parametrize("kind", [DynamicTree, umbel.BoxKdTree])
def test_boxes_of_queries_are_checked(kind: type[DynamicTree | umbel.BoxKdTree]) -> None:
    tree = kind(_boxes(200))
    for low, high, name in (
        ([0, 0], [0, 1, 1, 1], "low"),
        ([0, 0, 0], [1, 1], "high"),
        (0, 1, "low"),
        ([0, 0, 0], "abc", "high"),
    ):
        with pytest.raises(umbel.Error, match=f"^{name} must"):
            tree.overlaps_box(low, high)
    assert len(tree.overlaps_box([0, 0, 0], [1, 1, 1])) == 200
    for axis in range(3):  # as of the structures over triangles
        inverted = np.zeros((2, 3))
        inverted[:, axis] = 0.6, 0.4
        inverted[1, [a for a in range(3) if a != axis]] = 1
        assert len(tree.overlaps_box(*inverted)) == 0


def test_numbers_that_no_box_has() -> None:
    tree = DynamicTree(_boxes(5))
    assert 4 in tree and np.uint32(4) in tree
    for number in (5, -1, 2**32 + 1, 2**40, 1.0, "a", None):
        assert number not in tree
    for wrong in (1.7, -1, 2**40, "a"):
        with pytest.raises(umbel.Error, match=r"^number must be"):
            tree.box(wrong)  # type: ignore[arg-type]
    with pytest.raises(umbel.Error, match=r"^max_leaf_size must be"):
        tree.snapshot(2.5)  # type: ignore[arg-type]
