"""What hierarchies answer from Python: that it is right, in the shapes promised, and that mistakes
are sentences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import umbel
from helpers.hierarchies import (
    ball_rays,
    brute_force,
    is_clear,
    nearest,
    random_directions,
    random_soup,
)

BUILDERS = umbel.bvh.builders()
Mesh = umbel.Mesh


# ---- rays ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("builder", [*umbel.bvh.PRESETS, *BUILDERS, "kmeans-q1", "aac-hq"])
def test_every_builder_hits_what_brute_force_hits(blob: Mesh, builder: str) -> None:
    origins, directions = ball_rays(200)
    t, inside = brute_force(blob, origins, directions)
    expected, clear = nearest(t, inside), is_clear(t, inside)
    assert clear.sum() > 150 and np.isfinite(expected).sum() > 50
    for width in (2, 4, 8):
        found = umbel.Bvh(blob, builder=builder, width=width)
        hits = found.intersect(origins, directions)
        assert np.array_equal(hits.hit[clear], np.isfinite(expected)[clear])
        assert np.allclose(hits.t[clear], expected[clear], rtol=1e-5, atol=1e-6)
        assert np.array_equal(found.occluded(origins, directions), hits.hit)
        assert found.statistics()["width"] == width


def test_hits_lie_where_they_say(blob: Mesh, bvh: umbel.Bvh) -> None:
    origins, directions = ball_rays(500, 2)
    hits = bvh.intersect(origins, directions)
    for array, kind in ((hits.t, "f4"), (hits.primitive, "i4"), (hits.u, "f4"), (hits.v, "f4")):
        assert array.dtype == kind and array.shape == (500,)
    assert len(hits) == 500 and np.array_equal(hits.hit, hits.primitive >= 0)
    assert np.isinf(hits.t[~hits.hit]).all()
    h = hits.hit
    a, b, c = blob.positions[blob.triangles[hits.primitive[h]]].transpose(1, 0, 2)
    u, v = hits.u[h, None], hits.v[h, None]
    on_triangle = (1 - u - v) * a + u * b + v * c
    assert np.allclose(on_triangle, origins[h] + hits.t[h, None] * directions[h], atol=1e-5)


def test_shapes_and_types_that_mean_the_same_give_the_same(bvh: umbel.Bvh) -> None:
    origins, directions = ball_rays(300, 3)
    expected = bvh.intersect(origins, directions)
    fortran = np.asfortranarray(origins)
    sliced = np.zeros((600, 6), np.float32)
    sliced[::2, ::2] = directions
    read_only = origins.copy()
    read_only.setflags(write=False)
    for o, d in (
        (origins.astype(np.float64), directions),
        (origins.tolist(), directions.tolist()),
        (fortran, sliced[::2, ::2]),
        (read_only, directions),
        (origins[::-1][::-1], directions),
    ):
        hits = bvh.intersect(o, d)
        for one, other in zip(vars(hits).values(), vars(expected).values(), strict=True):
            assert np.array_equal(one, other)
    whole = bvh.intersect(np.zeros((2, 3), int), np.array([[1, 0, 0], [0, 1, 0]]))
    assert whole.hit.all()


def test_one_origin_or_direction_serves_all_rays(bvh: umbel.Bvh) -> None:
    directions = random_directions(50, 4)
    hits = bvh.intersect([0, 0, 0], directions)
    assert np.array_equal(hits.t, bvh.intersect(np.zeros((50, 3)), directions).t)
    origins, _ = ball_rays(50, 4)
    hits = bvh.intersect(origins, (0, 0, 1))
    assert np.array_equal(hits.t, bvh.intersect(origins, np.tile([0, 0, 1], (50, 1))).t)
    assert len(bvh.intersect([0, 0, 0], [0, 0, 1])) == 1
    for nothing in ([], np.zeros((0, 3))):
        assert len(bvh.intersect(nothing, nothing)) == 0
        assert len(bvh.intersect(nothing, [0, 0, 1])) == 0
        assert len(bvh.occluded([0, 0, 0], nothing)) == 0
        assert len(bvh.all_hits(nothing, nothing)) == 0


def test_intervals_leave_out_what_is_before_and_behind(bvh: umbel.Bvh) -> None:
    directions = random_directions(200, 5)
    near = bvh.intersect([0, 0, 0], directions)
    assert near.hit.all()
    assert not bvh.intersect([0, 0, 0], directions, t_max=near.t * 0.99).hit.any()
    assert bvh.intersect([0, 0, 0], directions, t_max=near.t).hit.all()
    assert bvh.intersect([0, 0, 0], directions, t_min=near.t).hit.all()
    assert not bvh.occluded([0, 0, 0], directions, t_max=float(near.t.min()) / 2).any()
    one = bvh.intersect([0, 0, 0], directions, 0.0, near.t[0])
    assert np.array_equal(one.hit, near.t <= near.t[0])
    # Empty intervals, NaN and zero directions find nothing.
    assert not bvh.intersect([0, 0, 0], directions, 2.0, 1.0).hit.any()
    assert not bvh.intersect([0, 0, 0], directions, math.nan).hit.any()
    assert not bvh.occluded([0, 0, 0], np.zeros((3, 3))).any()
    assert not bvh.occluded([math.nan, 0, 0], directions).any()


def test_all_hits_are_the_triangles_on_the_ray_nearest_first() -> None:
    soup = random_soup(400, 0.5)
    bvh = umbel.Bvh(soup)
    low, high = soup.positions.min(axis=0), soup.positions.max(axis=0)
    random = np.random.default_rng(6)
    origins = (random.uniform(-1, 2, (150, 3)) * (high - low) + low).astype(np.float32)
    directions = (random.uniform(0, 1, (150, 3)) * (high - low) + low).astype(np.float32) - origins
    t, inside = brute_force(soup, origins, directions)
    clear = is_clear(t, inside)
    found = bvh.all_hits(origins, directions)
    assert len(found) == 150 and found.offsets.dtype == np.int64
    assert found.primitive.dtype == np.int32 and len(found.ray) == len(found.t) == len(found.u)
    assert np.array_equal(found.counts, np.bincount(found.ray, minlength=150))
    for i in np.flatnonzero(clear):
        mine = slice(found.offsets[i], found.offsets[i + 1])
        expected = np.flatnonzero((inside[i] >= 0) & (t[i] >= 0))
        assert set(found.primitive[mine]) == set(expected)
        assert (np.diff(found.t[mine]) >= 0).all()
    assert found.counts.max() > 3
    for most in (1, 2, 5):
        bounded = bvh.all_hits(origins, directions, max_hits=most)
        assert np.array_equal(bounded.counts, np.minimum(found.counts, most))
        kept = np.concatenate(
            [np.arange(s, s + n) for s, n in zip(found.offsets[:-1], bounded.counts, strict=True)]
        )
        assert np.array_equal(bounded.primitive, found.primitive[kept])
        assert np.array_equal(bounded.t, found.t[kept])


def test_masks_select_triangles(blob: Mesh) -> None:
    count = len(blob.triangles)
    masks = np.uint32(1) << (np.arange(count, dtype=np.uint32) % 4)
    bvh = umbel.Bvh(blob, masks=masks)
    origins, directions = ball_rays(300, 7)
    everything = bvh.all_hits(origins, directions)
    for mask in (1, 4, 5, 15):
        seen = (masks[everything.primitive] & mask) != 0
        found = bvh.all_hits(origins, directions, mask=mask)
        assert np.array_equal(found.primitive, everything.primitive[seen])
        first = bvh.intersect(origins, directions, mask=mask)
        assert np.array_equal(first.hit, found.counts > 0)
        assert np.array_equal(first.hit, bvh.occluded(origins, directions, mask=mask))
    assert not bvh.occluded(origins, directions, mask=0).any()
    assert not bvh.occluded(origins, directions, mask=1 << 31).any()
    assert umbel.Bvh(blob).occluded(origins, directions, mask=1 << 31).any()


def test_all_hits_of_more_rays_than_are_traced_at_once() -> None:
    bvh = umbel.Bvh(umbel.shapes.sphere(0))
    count = (1 << 20) + 1
    origins = np.zeros((count, 3), np.float32)
    origins[:, 2] = np.where(np.arange(count) % 3 == 0, 0, 2)  # within: one hit; below: none
    origins[-2:, 2] = -2  # all the way through, before and behind where the first part ends
    found = bvh.all_hits(origins, [0.01, 0.02, 1])
    assert found.offsets[-1] == len(found.t) == len(found.primitive) == len(found.u)
    assert (found.counts[:-2] == (np.arange(count - 2) % 3 == 0)).all()
    assert found.counts[-2:].tolist() == [2, 2]
    assert np.array_equal(found.t[-4:-2], found.t[-2:]) and found.t[-2] < found.t[-1]


def test_back_faces_are_seen_or_not() -> None:
    bvh = umbel.Bvh(umbel.shapes.sphere(3))
    directions = random_directions(100, 8)
    assert bvh.occluded([0, 0, 0], directions).all()
    for cull in (True, np.True_):
        assert not bvh.occluded([0, 0, 0], directions, cull_back_faces=cull).any()
    outside = 3 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    assert bvh.occluded(outside, -directions, cull_back_faces=True).all()
    counts = bvh.all_hits(outside, -directions, cull_back_faces=True).counts
    assert (bvh.all_hits(outside, -directions).counts >= counts + 1).all()


# ---- points and regions --------------------------------------------------------------------------


def _closest_by_force(mesh: Mesh, points: NDArray[np.float32]) -> NDArray[np.float64]:
    """Distances to the surface, by trimesh."""
    import trimesh

    corners = mesh.positions[mesh.triangles].astype(np.float64)
    best = np.full(len(points), np.inf)
    for i, point in enumerate(points.astype(np.float64)):
        nearest = trimesh.triangles.closest_point(corners, np.tile(point, (len(corners), 1)))
        best[i] = np.linalg.norm(nearest - point, axis=1).min()
    return best


def test_closest_points_are_the_closest(blob: Mesh, bvh: umbel.Bvh) -> None:
    points = ball_rays(80, 9)[0]
    found = bvh.closest_point(points)
    expected = _closest_by_force(blob, points)
    assert len(found) == 80
    assert np.allclose(found.distance, expected, rtol=1e-5, atol=1e-6)
    assert np.allclose(np.linalg.norm(found.point - points, axis=1), found.distance, atol=1e-5)
    a, b, c = blob.positions[blob.triangles[found.primitive]].transpose(1, 0, 2)
    u, v = found.u[:, None], found.v[:, None]
    assert np.allclose((1 - u - v) * a + u * b + v * c, found.point, atol=1e-5)
    limit = float(np.median(expected))
    near = bvh.closest_point(points, limit)
    assert np.array_equal(near.primitive >= 0, found.distance <= limit)
    assert np.isinf(near.distance[near.primitive < 0]).all()
    nowhere = bvh.closest_point([[math.nan, 0, 0]])
    assert nowhere.primitive[0] == -1 and np.isinf(nowhere.distance[0])


def test_inside_and_signed_distance_agree_with_the_ball() -> None:
    sphere = umbel.shapes.sphere(4)
    bvh = umbel.Bvh(sphere)
    points = ball_rays(2000, 10)[0]
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 1) > 0.01
    inside = bvh.contains(points)
    assert inside.dtype == bool and np.array_equal(inside[clear], (radius < 1)[clear])
    signed = bvh.signed_distance(points)
    assert signed.dtype == np.float32
    assert np.allclose(signed, radius - 1, atol=0.01)
    assert np.array_equal(signed[clear] < 0, inside[clear])
    assert np.allclose(np.abs(signed), bvh.closest_point(points).distance, atol=1e-6)
    # At every vertex's height, where a careless ray would pass along edges.
    inner = sphere.positions * np.float32(0.9)
    assert bvh.contains(inner).all()
    assert not bvh.contains(sphere.positions * np.float32(1.1)).any()


def test_overlaps_are_those_of_brute_force(blob: Mesh, bvh: umbel.Bvh) -> None:
    corners = blob.positions[blob.triangles]
    low, high = np.array([0.1, 0.0, -0.2], np.float32), np.array([0.9, 0.7, 0.6], np.float32)
    found = bvh.overlaps_box(low, high)
    assert found.dtype == np.int32 and (np.diff(found) > 0).all()
    has_corner = ((corners >= low) & (corners <= high)).all(axis=2).any(axis=1)
    boxes_meet = ((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)
    assert set(np.flatnonzero(has_corner)) <= set(found) <= set(np.flatnonzero(boxes_meet))

    center, radius = np.array([0.5, 0.5, 0.5], np.float32), 0.4
    found = bvh.overlaps_sphere(center, radius)
    import trimesh

    nearest = trimesh.triangles.closest_point(
        corners.astype(np.float64), np.tile(center.astype(np.float64), (len(corners), 1))
    )
    distance = np.linalg.norm(nearest - center, axis=1)
    assert np.array_equal(found, np.flatnonzero(distance <= radius))

    planes = [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (-1, 0, 0, 2), (0, -1, 0, 2), (0, 0, -1, 2)]
    found = bvh.overlaps_frustum(planes)
    octant = (corners.max(axis=1) >= 0).all(axis=1)
    assert np.array_equal(found, np.flatnonzero(octant)) and 0 < len(found) < len(corners)


# ---- mistakes ------------------------------------------------------------------------------------


def _good() -> tuple[umbel.Bvh, NDArray[np.float32], NDArray[np.float32]]:
    return (umbel.Bvh(umbel.shapes.sphere(1)), *ball_rays(4))


QUERY_MISTAKES: list[tuple[str, str]] = [
    ("b.intersect(o, d[:3])", "rays"),
    ("b.intersect(o[:, :2], d)", "origins must have shape"),
    ("b.intersect(o, d[None])", "directions must have shape"),
    ("b.intersect(o, [['a', 'b', 'c']])", "directions must hold numbers"),
    ("b.intersect(o, None)", "directions must hold numbers"),
    ("b.intersect(o, d + 1j)", "directions must hold numbers"),
    ("b.intersect(o, d, t_min=[0, 0])", "t_min"),
    ("b.intersect(o, d, t_min=[])", "t_min is empty"),
    ("b.intersect(o, d, t_max=np.zeros((4, 1)))", "t_max"),
    ("b.intersect(o, d, t_max='far')", "t_max must hold numbers"),
    ("b.intersect(o, d, mask=-1)", "mask"),
    ("b.intersect(o, d, mask=1 << 32)", "mask"),
    ("b.intersect(o, d, mask=1.5)", "mask"),
    ("b.intersect(o, d, mask='all')", "mask"),
    ("b.intersect(o, d, threads=-1)", "threads"),
    ("b.occluded(o, d, threads='all')", "threads"),
    ("b.all_hits(o, d, max_hits=-1)", "max_hits"),
    ("b.all_hits(o, d, max_hits=2.5)", "max_hits"),
    ("b.closest_point(o[0])", "points must have shape"),
    ("b.closest_point(['x'])", "points must hold numbers"),
    ("b.closest_point(o, -1)", "max_distance"),
    ("b.closest_point(o, math.nan)", "max_distance"),
    ("b.closest_point(o, 'far')", "max_distance"),
    ("b.contains(o[:, :2])", "points must have shape"),
    ("b.signed_distance(None)", "points must hold numbers"),
    ("b.contains([[0, 0, 0], [0, 0]])", "points must be an array"),
    ("b.overlaps_box((0, 0), (1, 1, 1))", "low must have shape"),
    ("b.overlaps_box((0, 0, 0), 'abc')", "high must hold numbers"),
    ("b.overlaps_sphere((0, 0, 0), 'wide')", "radius"),
    ("b.overlaps_sphere((0, 0, 0, 0), 1)", "center must have shape"),
    ("b.overlaps_frustum(np.zeros((5, 4)))", "planes must have shape"),
    ("b.refit(o)", "out of range"),
    ("b.refit(o, [[0, 1, 2]])", "refit takes the triangles"),
    ("b.refit('positions')", "positions must hold numbers"),
    ("b.save('/proc/no/such.umbvh')", "such.umbvh"),
]


@pytest.mark.parametrize(("call", "sentence"), QUERY_MISTAKES, ids=[c for c, _ in QUERY_MISTAKES])
def test_mistakes_of_queries_are_sentences(call: str, sentence: str) -> None:
    b, o, d = _good()
    with pytest.raises(umbel.Error, match=sentence):
        eval(call, {"b": b, "o": o, "d": d, "np": np, "math": math})
