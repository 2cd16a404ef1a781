"""What must hold of the clusters of any boxes, on generated ones."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import umbel

# Coordinates are multiples of this below 2**10, so that sums with whole numbers below 2**10 and
# their halves are exact in float32.
STEP = 2.0**-9

settings.register_profile(
    "clusters",
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.load_profile("clusters")


@dataclass(frozen=True)
class Case:
    """Boxes and what to make of them."""

    boxes: NDArray[np.float32]
    segments: NDArray[np.uint32]
    options: dict[str, Any]

    def build(self, **changes: Any) -> umbel.Clusters:
        given = {"boxes": self.boxes, "segments": self.segments, **self.options} | changes
        return umbel.build_clusters(**given)


def spread(seed: int, count: int, crowded: bool) -> NDArray[np.float32]:
    """Boxes whose centres differ on every axis; or crowded on few places, many of them points."""
    rng = np.random.default_rng(seed)
    if crowded:
        centers = rng.integers(0, 6, (count, 3)) * 16
        half = rng.integers(0, 2, (count, 3))
    else:
        centers = np.stack([rng.permutation(count) for _ in range(3)], axis=1) + 8
        half = rng.integers(0, 8, (count, 3))
    corners = np.concatenate([centers - half, centers + half], axis=1)
    return (corners * (2 * STEP)).astype(np.float32)


@st.composite
def segments_of(draw: st.DrawFn, count: int) -> NDArray[np.uint32]:
    """Ranges that do not overlap, some empty, with or without gaps between them."""
    cuts = sorted(draw(st.lists(st.integers(0, count), min_size=2, max_size=8)))
    ranges = [(begin, end - begin) for begin, end in itertools.pairwise(cuts)]
    kept = draw(st.lists(st.booleans(), min_size=len(ranges), max_size=len(ranges)))
    chosen = [segment for segment, keep in zip(ranges, kept, strict=True) if keep]
    return np.array(chosen or [(0, count)], np.uint32)


@st.composite
def cases(draw: st.DrawFn, crowded: bool | None = None, most: int = 3000) -> Case:
    count = draw(st.integers(1, 60) | st.integers(1, most))
    if crowded is None:
        crowded = draw(st.booleans())
    boxes = spread(draw(st.integers(0, 2**32 - 1)), count, crowded)
    max_items = draw(st.integers(1, 130))
    preset = draw(st.sampled_from(["quality", "fast", "exact"]))
    options: dict[str, Any] = {"max_items": max_items, "preset": preset}
    if preset != "exact":
        options["min_items"] = draw(st.integers(1, max_items))
        options["underfill_cost"] = draw(st.floats(0, 1))
        options["overlap_cost"] = draw(st.sampled_from([0.0, 0.0, 0.3, 1.0]))
        options["coarse"] = draw(st.booleans())
    options["presplit_threshold"] = draw(st.sampled_from([0, 0, 200]))
    return Case(boxes, draw(segments_of(count)), options)


def partition(clusters: umbel.Clusters, names: NDArray[np.int64]) -> set[tuple[int, ...]]:
    """The clusters as sets of the items' names."""
    return {
        tuple(sorted(names[clusters.items[offset : offset + count]].tolist()))
        for offset, count in clusters.ranges.tolist()
    }


def assert_same(one: umbel.Clusters, other: umbel.Clusters) -> None:
    for name in ("items", "ranges", "segments"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


@given(cases())
def test_each_item_is_in_one_cluster_of_its_own_segment(case: Case) -> None:
    clusters = case.build(threads=1)
    count = len(case.boxes)
    assert np.array_equal(np.sort(clusters.items), np.arange(count))
    assert len(clusters.segments) == len(case.segments)
    outside = np.ones(count, bool)
    for (offset, size), (first, clusters_of_it) in zip(
        case.segments.tolist(), clusters.segments.tolist(), strict=True
    ):
        place = offset
        for begin, items in clusters.ranges[first : first + clusters_of_it].tolist():
            assert begin == place and items > 0
            place += items
        assert place == offset + size
        own = clusters.items[offset:place]
        assert np.array_equal(np.sort(own), np.arange(offset, place))
        outside[offset:place] = False
    assert np.array_equal(clusters.items[outside], np.flatnonzero(outside))
    labels = clusters.labels()
    assert np.array_equal(labels == 0xFFFFFFFF, outside)


@given(cases())
def test_sizes_are_within_limits_but_for_one_a_segment(case: Case) -> None:
    clusters = case.build(threads=1)
    least = case.options.get("min_items", case.options["max_items"])
    for first, number in clusters.segments.tolist():
        sizes = clusters.ranges[first : first + number, 1]
        assert (sizes <= case.options["max_items"]).all()
        assert (sizes < least).sum() <= 1


@given(cases(most=12_000))
def test_threads_change_nothing(case: Case) -> None:
    one = case.build(threads=1)
    for threads in (2, 8):
        assert_same(one, case.build(threads=threads))


@given(cases(), st.integers(-60, 60))
def test_scale_by_a_power_of_two_changes_nothing(case: Case, exponent: int) -> None:
    scaled = np.ldexp(case.boxes, exponent)
    assert np.array_equal(np.ldexp(scaled, -exponent), case.boxes)
    assert_same(case.build(), case.build(boxes=scaled))


@given(cases(), st.tuples(*[st.integers(-500, 500)] * 3))
def test_translation_without_rounding_changes_nothing(
    case: Case, move: tuple[int, int, int]
) -> None:
    moved = case.boxes + np.array([*move, *move], np.float32)
    assert np.array_equal(moved - np.array([*move, *move], np.float32), case.boxes)
    assert_same(case.build(), case.build(boxes=moved))


@given(cases(crowded=False, most=12_000), st.integers(0, 2**32 - 1))
def test_order_of_items_changes_nothing_where_no_centres_are_equal(case: Case, seed: int) -> None:
    # `coarse` takes centres for equal that are only close.
    exact = case.options["preset"] == "exact"
    fine = {"coarse": False, "preset": "exact" if exact else "quality"}
    order = np.arange(len(case.boxes))
    rng = np.random.default_rng(seed)
    for offset, count in case.segments.tolist():
        order[offset : offset + count] = offset + rng.permutation(count)
    shuffled = case.build(boxes=case.boxes[order], **fine)
    assert partition(shuffled, order) == partition(case.build(**fine), np.arange(len(order)))


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 2000),
    st.integers(1, 6),
    st.integers(0, 40),
    st.sampled_from([0.0, 0.1, 1.0, 100.0]),
)
def test_vertex_limits_hold_for_items_of_any_arity(
    seed: int, count: int, arity: int, room: int, weight: float
) -> None:
    rng = np.random.default_rng(seed)
    boxes = spread(seed, count, crowded=False)
    vertices = rng.integers(0, count, (count, arity))
    limit = arity + room
    clusters = umbel.build_clusters(
        boxes,
        48,
        min_items=12,
        max_vertices=limit,
        item_vertices=vertices,
        shared_vertex_weight=weight,
    )
    parts = np.split(clusters.items, clusters.offsets[1:-1])
    assert np.array_equal(np.sort(clusters.items), np.arange(count))
    assert max(len(np.unique(vertices[part])) for part in parts) <= limit
    metrics = clusters.metrics()
    assert metrics["max_vertices"] == max(len(np.unique(vertices[part])) for part in parts)
    assert (metrics["ratio_cut"] == 0) or weight > 0


@given(
    st.integers(0, 2**32 - 1),
    st.integers(2, 1500),
    st.sampled_from([0.0, 1e-30, 1.0, 1e6, 3e38]),
)
def test_any_connection_weights_keep_the_guarantees(seed: int, count: int, weight: float) -> None:
    rng = np.random.default_rng(seed)
    degrees = rng.integers(0, 6, count)
    offsets = np.concatenate([[0], np.cumsum(degrees)])
    targets = rng.integers(0, count, offsets[-1])
    weights = rng.choice([0.0, weight], offsets[-1]).astype(np.float32)
    connections = (offsets, targets, weights)
    boxes = spread(seed, count, crowded=False)
    one = umbel.build_clusters(boxes, 32, min_items=8, connections=connections, threads=1)
    assert np.array_equal(np.sort(one.items), np.arange(count))
    sizes = np.diff(one.offsets)
    assert sizes.max() <= 32 and (sizes < 8).sum() <= 1
    assert_same(
        one, umbel.build_clusters(boxes, 32, min_items=8, connections=connections, threads=8)
    )


@pytest.mark.parametrize("shape", ["blob", "terrain", "soup"])
def test_meshes_of_many_blocks_give_one_result(shape: str) -> None:
    mesh = {
        "blob": lambda: umbel.shapes.blob(6),
        "terrain": lambda: umbel.shapes.terrain(200, 200),
        "soup": lambda: umbel.shapes.soup(70_000),
    }[shape]()
    one = umbel.cluster_mesh(mesh, threads=1)
    for threads in (2, 8):
        assert_same(one, umbel.cluster_mesh(mesh, threads=threads))
    larger = umbel.Mesh(np.ldexp(mesh.positions, 5), mesh.triangles)
    assert_same(one, umbel.cluster_mesh(larger))
