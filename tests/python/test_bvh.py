"""Hierarchies from Python: what goes in, what comes out, and that answers are right."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import umbel

BUILDERS = umbel.bvh.builders()
Mesh = umbel.Mesh


def _directions(count: int, seed: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).normal(size=(count, 3)).astype(np.float32)


def _rays(count: int, seed: int = 1) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rays through and beside the unit ball."""
    random = np.random.default_rng(seed)
    origins = random.uniform(-2, 2, (count, 3)).astype(np.float32)
    targets = random.uniform(-1, 1, (count, 3)).astype(np.float32)
    return origins, targets - origins


def _soup(count: int, size: float) -> Mesh:
    """Random triangles of about that size in the unit box."""
    random = np.random.default_rng(20)
    middle = random.uniform(0, 1, (count, 1, 3))
    corners = middle + random.uniform(-size, size, (count, 3, 3))
    return Mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count).reshape(-1, 3))


def _brute_force(
    mesh: Mesh, origins: NDArray[np.float32], directions: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For every ray and triangle (n, m), in double precision: t of the plane, and how far inside
    the triangle it is met (the least barycentric coordinate)."""
    a, b, c = mesh.positions[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    o, d = origins.astype(np.float64)[:, None], directions.astype(np.float64)[:, None]
    with np.errstate(all="ignore"):
        p = np.cross(d, (c - a)[None])
        det = np.einsum("nmk,mk->nm", p, b - a)
        s = o - a[None]
        u = np.einsum("nmk,nmk->nm", s, p) / det
        q = np.cross(s, (b - a)[None])
        v = np.einsum("nmk,nmk->nm", q, np.broadcast_to(d, q.shape)) / det
        t = np.einsum("nmk,mk->nm", q, c - a) / det
        inside = np.minimum(np.minimum(u, v), 1 - u - v)
    return np.where(np.isnan(t), np.inf, t), np.where(np.isnan(inside), -np.inf, inside)


def _nearest(t: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where((inside >= 0) & (t >= 0), t, np.inf).min(axis=1)


def _is_clear(t: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rays that pass no triangle's border so closely that single precision could not tell."""
    return ~((np.abs(inside) < 1e-5) & (t > -1e-3)).any(axis=1)


@pytest.fixture(scope="module")
def blob() -> Mesh:
    return umbel.shapes.blob(3)


@pytest.fixture(scope="module")
def bvh(blob: Mesh) -> umbel.Bvh:
    return umbel.Bvh(blob)


# ---- rays ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("builder", [*umbel.bvh.PRESETS, *BUILDERS, "kmeans-q1", "aac-hq"])
def test_every_builder_hits_what_brute_force_hits(blob: Mesh, builder: str) -> None:
    origins, directions = _rays(200)
    t, inside = _brute_force(blob, origins, directions)
    expected, clear = _nearest(t, inside), _is_clear(t, inside)
    assert clear.sum() > 150 and np.isfinite(expected).sum() > 50
    for width in (2, 4, 8):
        found = umbel.Bvh(blob, builder=builder, width=width)
        hits = found.intersect(origins, directions)
        assert np.array_equal(hits.hit[clear], np.isfinite(expected)[clear])
        assert np.allclose(hits.t[clear], expected[clear], rtol=1e-5, atol=1e-6)
        assert np.array_equal(found.occluded(origins, directions), hits.hit)
        assert found.statistics()["width"] == width


def test_hits_lie_where_they_say(blob: Mesh, bvh: umbel.Bvh) -> None:
    origins, directions = _rays(500, 2)
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
    origins, directions = _rays(300, 3)
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
    directions = _directions(50, 4)
    hits = bvh.intersect([0, 0, 0], directions)
    assert np.array_equal(hits.t, bvh.intersect(np.zeros((50, 3)), directions).t)
    origins, _ = _rays(50, 4)
    hits = bvh.intersect(origins, (0, 0, 1))
    assert np.array_equal(hits.t, bvh.intersect(origins, np.tile([0, 0, 1], (50, 1))).t)
    assert len(bvh.intersect([0, 0, 0], [0, 0, 1])) == 1
    for nothing in ([], np.zeros((0, 3))):
        assert len(bvh.intersect(nothing, nothing)) == 0
        assert len(bvh.intersect(nothing, [0, 0, 1])) == 0
        assert len(bvh.occluded([0, 0, 0], nothing)) == 0
        assert len(bvh.all_hits(nothing, nothing)) == 0


def test_intervals_leave_out_what_is_before_and_behind(bvh: umbel.Bvh) -> None:
    directions = _directions(200, 5)
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
    soup = _soup(400, 0.5)
    bvh = umbel.Bvh(soup)
    low, high = soup.positions.min(axis=0), soup.positions.max(axis=0)
    random = np.random.default_rng(6)
    origins = (random.uniform(-1, 2, (150, 3)) * (high - low) + low).astype(np.float32)
    directions = (random.uniform(0, 1, (150, 3)) * (high - low) + low).astype(np.float32) - origins
    t, inside = _brute_force(soup, origins, directions)
    clear = _is_clear(t, inside)
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
    origins, directions = _rays(300, 7)
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


def test_back_faces_are_seen_or_not() -> None:
    bvh = umbel.Bvh(umbel.shapes.sphere(3))
    directions = _directions(100, 8)
    assert bvh.occluded([0, 0, 0], directions).all()
    assert not bvh.occluded([0, 0, 0], directions, cull_back_faces=True).any()
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
    points = _rays(80, 9)[0]
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
    points = _rays(2000, 10)[0]
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


# ---- building ------------------------------------------------------------------------------------


def test_whatever_holds_a_mesh_is_taken(blob: Mesh, tmp_path: Path) -> None:
    import trimesh

    path = tmp_path / "blob.ply"
    umbel.save(path, blob)
    expected = umbel.Bvh(blob).statistics()
    positions, triangles = blob.positions, blob.triangles
    for source in (
        (path,),
        (str(path),),
        (positions, triangles),
        ((positions, triangles),),
        (positions.astype(np.float64), triangles.astype(np.int64)),
        (positions.tolist(), triangles.tolist()),
        (np.asfortranarray(positions), np.asfortranarray(triangles)),
        (trimesh.Trimesh(positions, triangles, process=False),),
    ):
        assert umbel.Bvh(*source).statistics() == expected


def test_trees_have_the_structure_that_they_promise(blob: Mesh) -> None:
    for builder in BUILDERS:
        tree = umbel.build_bvh2(blob, builder=builder)
        nodes, primitives = tree.nodes, tree.primitives
        assert not nodes.flags.writeable and not primitives.flags.writeable
        leaf = nodes["count"] > 0
        assert set(primitives) == set(range(len(blob.triangles)))
        if builder != "sbvh":
            assert len(primitives) == len(blob.triangles)
        assert nodes["count"].sum() == len(primitives) and nodes["count"].max() <= 8
        parents = np.flatnonzero(~leaf)
        for child in (nodes["first"][parents], nodes["first"][parents] + 1):
            assert (child > parents).all()
            assert (nodes["min"][child] >= nodes["min"][parents]).all()
            assert (nodes["max"][child] <= nodes["max"][parents]).all()
        statistics = tree.statistics()
        assert statistics["nodes"] == len(nodes) and statistics["leaves"] == leaf.sum()
        extent = (nodes["max"] - nodes["min"]).astype(np.float64)
        area = (extent * np.roll(extent, 1, axis=1)).sum(axis=1)
        cost = (area * np.where(leaf, 2.0 * nodes["count"], 3.0)).sum() / area[0]
        assert math.isclose(tree.sah_cost(), cost, rel_tol=1e-5)
        assert tree.sah_cost((6, 4)) == pytest.approx(2 * tree.sah_cost())
        assert 0 <= tree.epo() < tree.sah_cost()


def test_trees_over_boxes_and_hierarchies_from_trees(blob: Mesh) -> None:
    corners = blob.positions[blob.triangles]
    boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)])
    over_boxes = umbel.build_bvh2(boxes, builder="sweep")
    over_mesh = umbel.build_bvh2(blob, builder="sweep")
    assert np.array_equal(over_boxes.nodes, over_mesh.nodes)
    with pytest.raises(umbel.Error, match="triangles"):
        over_boxes.epo()
    with pytest.raises(umbel.Error, match="sbvh"):
        umbel.build_bvh2(boxes, builder="sbvh")
    origins, directions = _rays(200, 11)
    made = umbel.Bvh.from_tree(over_boxes, blob, width=4)
    assert np.array_equal(
        made.intersect(origins, directions).t, umbel.Bvh(blob).intersect(origins, directions).t
    )
    kept = umbel.Bvh(blob, builder="sweep", keep_tree=True)
    assert kept.tree is not None and np.array_equal(kept.tree.nodes, over_mesh.nodes)
    assert kept.epo == over_mesh.epo() and kept.sah_cost == over_mesh.sah_cost()
    with pytest.raises(umbel.Error, match="keep_tree"):
        _ = umbel.Bvh(blob).epo
    assert len(kept) == len(blob.triangles) and str(len(kept)) in repr(kept)


OPTIONS: list[tuple[str, dict[str, Any]]] = [
    ("binned", {"max_leaf_size": 1}),
    ("binned", {"bins": 4}),
    ("binned", {"cost": (10.0, 1.0)}),
    ("binned", {"reinsertion_rounds": 2}),
    ("sbvh", {"spatial_budget": 0.0}),
    ("sbvh", {"spatial_overlap": 1.0}),
    ("lbvh", {"morton_bits": 30}),
    ("hlbvh", {"hlbvh_bits": 3}),
    ("kmeans", {"clusters": 3}),
    ("kmeans", {"candidates": 1}),
    ("kmeans", {"iterations": 0}),
    ("kmeans", {"distance": "manhattan"}),
    ("aac", {"aac_leaf_size": 40}),
    ("aac", {"aac_epsilon": 0.0}),
    ("ploc", {"ploc_radius": 1}),
    ("atrbvh", {"treelet_size": 3}),
    ("atrbvh", {"treelet_rounds": 1}),
]


@pytest.mark.parametrize(
    ("builder", "options"),
    [case for case in OPTIONS if case[0] in BUILDERS],
    ids=lambda value: value if isinstance(value, str) else next(iter(value)),
)
def test_every_option_changes_the_tree(builder: str, options: dict[str, Any]) -> None:
    # Large triangles, so that spatial splits are worth it, and a crowd of small ones, whose codes
    # are equal in 30 bits.
    soup = _soup(2000, 0.2)
    crowd = Mesh(soup.positions * np.float32(1e-3), soup.triangles + np.uint32(6000))
    soup = Mesh(
        np.concatenate([soup.positions, crowd.positions]),
        np.concatenate([soup.triangles, crowd.triangles]),
    )
    plain = umbel.build_bvh2(soup, builder=builder)
    changed = umbel.build_bvh2(soup, builder=builder, **options)
    assert not np.array_equal(plain.nodes, changed.nodes)
    set_to_none = umbel.build_bvh2(soup, builder=builder, **dict.fromkeys(options))
    assert np.array_equal(plain.nodes, set_to_none.nodes)


def test_depth_is_bounded() -> None:
    spiral = np.geomspace(1e-15, 1e15, 400, dtype=np.float32)
    boxes = np.column_stack([-spiral, -spiral, -spiral, spiral, spiral, spiral])
    for builder in set(BUILDERS) - {"sbvh"}:
        tree = umbel.build_bvh2(boxes, builder=builder, max_depth=20, max_leaf_size=2)
        assert tree.statistics()["max_depth"] <= 20


def test_results_do_not_depend_on_threads_nor_on_instructions(blob: Mesh) -> None:
    origins, directions = _rays(3000, 12)
    for builder in BUILDERS:
        one = umbel.build_bvh2(blob, builder=builder, threads=1)
        many = umbel.build_bvh2(blob, builder=builder, threads=3)
        assert np.array_equal(one.nodes, many.nodes)
        assert np.array_equal(one.primitives, many.primitives)
    bvh = umbel.Bvh(blob, simd="portable")
    expected = bvh.intersect(origins, directions, threads=1)
    for simd in ("auto", "avx2", "avx512"):
        try:
            other = umbel.Bvh(blob, simd=simd)
        except umbel.Error as error:
            assert error.code == "unsupported"
            continue
        found = other.intersect(origins, directions, threads=3)
        for one_array, other_array in zip(
            vars(expected).values(), vars(found).values(), strict=True
        ):
            assert np.array_equal(one_array, other_array)


def test_progress_is_told_and_may_cancel(blob: Mesh) -> None:
    told: list[float] = []
    umbel.Bvh(blob, progress=lambda fraction, stage: told.append(fraction) if stage else False)
    assert told == sorted(told) and told[-1] == 1.0
    with pytest.raises(umbel.Cancelled):
        umbel.Bvh(blob, progress=lambda fraction, stage: False)

    def fail(fraction: float, stage: str) -> None:
        raise KeyError(stage)

    with pytest.raises(KeyError):
        umbel.build_bvh2(blob, progress=fail)
    bvh = umbel.Bvh(blob)
    with pytest.raises(umbel.Cancelled):
        bvh.refit(blob.positions, progress=lambda fraction, stage: False)


def _runs_beside(work: Any) -> int:
    """How often a Python thread came to run while another did `work`."""
    counts, stop = [0], threading.Event()

    def count() -> None:
        while not stop.is_set():
            counts[0] += 1
            time.sleep(0)

    other = threading.Thread(target=count)
    other.start()
    before = counts[0]
    work()
    after = counts[0]
    stop.set()
    other.join()
    return after - before


def test_python_runs_while_the_library_works() -> None:
    mesh = umbel.shapes.blob(6)
    bvh = umbel.Bvh(mesh)
    origins, directions = _rays(100_000, 13)
    # A call that holds the GIL lets the other thread run once or twice, before and after it.
    for work in (
        lambda: umbel.Bvh(mesh, builder="sweep", threads=1),
        lambda: bvh.intersect(origins, directions, threads=1),
        lambda: bvh.all_hits(origins, directions, threads=1),
        lambda: bvh.signed_distance(origins, threads=1),
    ):
        assert max(_runs_beside(work) for _ in range(5)) > 10


def test_threads_may_share_a_hierarchy(bvh: umbel.Bvh) -> None:
    origins, directions = _rays(5000, 14)
    expected = bvh.intersect(origins, directions)
    found: list[umbel.bvh.Hits] = []
    threads = [
        threading.Thread(target=lambda: found.append(bvh.intersect(origins, directions)))
        for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 6
    for hits in found:
        assert np.array_equal(hits.t, expected.t)
        assert np.array_equal(hits.primitive, expected.primitive)


# ---- empty and invalid ---------------------------------------------------------------------------


@pytest.mark.parametrize("builder", BUILDERS)
def test_empty_meshes_answer_every_query(builder: str) -> None:
    nothing = np.zeros((0, 3), np.uint32)
    for positions in (np.zeros((0, 3)), np.ones((5, 3))):
        bvh = umbel.Bvh(positions, nothing, builder=builder, keep_tree=True)
        origins, directions = _rays(4)
        assert not bvh.intersect(origins, directions).hit.any()
        assert not bvh.occluded(origins, directions).any()
        assert bvh.all_hits(origins, directions).counts.tolist() == [0, 0, 0, 0]
        assert (bvh.closest_point(origins).primitive == -1).all()
        assert not bvh.contains(origins).any()
        assert np.isposinf(bvh.signed_distance(origins)).all()
        assert len(bvh.overlaps_box((-1, -1, -1), (1, 1, 1))) == 0
        assert len(bvh.overlaps_sphere((0, 0, 0), 5)) == 0
        assert len(bvh.overlaps_frustum(np.zeros((6, 4)))) == 0
        assert bvh.bounds is None and len(bvh) == 0 and bvh.sah_cost == 0 and bvh.epo == 0
        assert not bvh.refit(positions).rebuild_advised


@pytest.mark.parametrize("builder", BUILDERS)
def test_invalid_triangles_are_refused_or_dropped(builder: str) -> None:
    sphere = umbel.shapes.sphere(2)
    positions = sphere.positions.copy()
    positions[5, 1], positions[17, 0] = np.nan, np.inf
    with pytest.raises(umbel.Error, match="not finite") as refused:
        umbel.Bvh(positions, sphere.triangles, builder=builder)
    assert refused.value.code == "invalid_mesh"
    bvh = umbel.Bvh(positions, sphere.triangles, builder=builder, invalid="drop", keep_tree=True)
    assert math.isfinite(bvh.epo)
    gone = np.isin(sphere.triangles, (5, 17)).any(axis=1)
    kept = umbel.Bvh(sphere.positions, sphere.triangles[~gone])
    origins, directions = _rays(300, 15)
    hits, expected = bvh.intersect(origins, directions), kept.intersect(origins, directions)
    assert np.array_equal(hits.t, expected.t)
    assert not gone[hits.primitive[hits.hit]].any()
    assert len(bvh) == len(sphere.triangles)
    triangles = sphere.triangles.copy()
    triangles[3, 1] = 100_000
    for invalid in ("refuse", "drop"):
        with pytest.raises(umbel.Error, match="triangle 3"):
            umbel.Bvh(sphere.positions, triangles, builder=builder, invalid=invalid)


def _good() -> tuple[umbel.Bvh, NDArray[np.float32], NDArray[np.float32]]:
    return (umbel.Bvh(umbel.shapes.sphere(1)), *_rays(4))


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


BUILD_MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({"builder": "magic"}, "builder is 'magic'"),
    ({"builder": None}, "builder must be a name"),
    ({"builder": "kmeans-q9"}, "q1"),
    ({"builder": "sweep-q1"}, "kmeans"),
    ({"width": 3}, "width must be 2, 4 or 8"),
    ({"width": "8"}, "width must be 2, 4 or 8"),
    ({"simd": "neon"}, "simd must be"),
    ({"masks": [1, 2]}, "masks must be"),
    ({"masks": []}, "masks must be"),
    ({"masks": np.full(80, -1)}, "masks must be from 0"),
    ({"masks": np.full(80, 0.5)}, "masks must be integers"),
    ({"invalid": "keep"}, "invalid must be"),
    ({"distance": "chebyshev"}, "distance must be"),
    ({"cost": (0, 1)}, "cost.traversal"),
    ({"cost": (1, math.inf)}, "cost.intersection"),
    ({"cost": 3}, "cost cannot be 3"),
    ({"max_leaf_size": 0}, "max_leaf_size is 0"),
    ({"max_leaf_size": -1}, "max_leaf_size cannot be -1"),
    ({"max_leaf_size": 2.5}, "max_leaf_size cannot be 2.5"),
    ({"max_depth": 7}, "max_depth is 7"),
    ({"bins": 3}, "bins is 3"),
    ({"spatial_budget": math.nan}, "spatial_budget is nan"),
    ({"morton_bits": 31}, "morton_bits is 31"),
    ({"aac_epsilon": 0.6}, "aac.epsilon is 0.6"),
    ({"clusters": 65}, "kmeans.clusters is 65"),
    ({"threads": -1}, "threads must be from 0"),
    ({"threads": 1 << 32}, "threads must be from 0"),
]


@pytest.mark.parametrize(
    ("options", "sentence"), BUILD_MISTAKES, ids=[str(o)[:40] for o, _ in BUILD_MISTAKES]
)
def test_mistakes_of_builds_are_sentences(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(umbel.Error, match=sentence):
        umbel.Bvh(umbel.shapes.sphere(1), **options)


def test_options_that_there_are_not_are_type_errors() -> None:
    with pytest.raises(TypeError, match="binz"):
        umbel.Bvh(umbel.shapes.sphere(1), binz=16)
    for wrong in (3, None, "no/such/file.ply", np.zeros((4, 5)), object()):
        with pytest.raises((umbel.Error, OSError)):
            umbel.Bvh(wrong)


# ---- refit and files -----------------------------------------------------------------------------


def test_refit_follows_and_says_when_to_rebuild(blob: Mesh) -> None:
    for compact in (False, True):
        bvh = umbel.Bvh(blob, compact=compact, keep_tree=True)
        built = bvh.sah_cost
        moved = blob.positions * np.float32(1.5) + np.float32(3)
        report = bvh.refit(moved)
        assert report.built_sah_cost == built and not report.rebuild_advised
        assert report.sah_cost == pytest.approx(built, rel=1e-3) and bvh.tree is None
        fresh = umbel.Bvh(moved, blob.triangles)
        origins, directions = _rays(300, 16)
        origins = origins * np.float32(1.5) + np.float32(3)
        assert np.array_equal(
            bvh.intersect(origins, directions).t, fresh.intersect(origins, directions).t
        )
        assert np.array_equal(bvh.bounds, fresh.bounds)
        shuffled = np.random.default_rng(1).permutation(blob.positions)
        report = bvh.refit(shuffled, threads=1)
        assert report.rebuild_advised and report.sah_cost > 1.5 * built
        with pytest.raises(umbel.Error, match="not finite"):
            bvh.refit(np.full_like(shuffled, np.nan))
        assert not np.isnan(bvh.bounds).any()


@pytest.mark.parametrize("width", [2, 4, 8])
@pytest.mark.parametrize("compact", [False, True])
def test_saved_files_answer_as_before(
    blob: Mesh, tmp_path: Path, width: int, compact: bool
) -> None:
    path = tmp_path / "blob.umbvh"
    masks = np.arange(len(blob.triangles)) % 7 + 1
    bvh = umbel.Bvh(blob, width=width, compact=compact, masks=masks)
    bvh.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["blob.umbvh"]
    again = umbel.Bvh.load(path)
    assert again.statistics() == bvh.statistics() and len(again) == len(bvh)
    assert np.array_equal(again.bounds, bvh.bounds)
    origins, directions = _rays(300, 17)
    for mask in (3, 0xFFFFFFFF):
        one = bvh.all_hits(origins, directions, mask=mask)
        other = again.all_hits(origins, directions, mask=mask)
        assert np.array_equal(one.primitive, other.primitive)
        assert np.array_equal(one.t, other.t)
    assert np.array_equal(again.signed_distance(origins), bvh.signed_distance(origins))
    with pytest.raises(umbel.Error, match="triangles must be given"):
        again.refit(blob.positions)
    assert not again.refit(blob.positions, blob.triangles).rebuild_advised
    assert not again.refit(blob.positions).rebuild_advised  # known by now
    bvh.save(path)
    bytes_before = path.read_bytes()
    umbel.Bvh(blob, width=width, compact=compact, masks=masks, threads=1).save(path)
    assert path.read_bytes() == bytes_before


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "mesh.umbvh"
    umbel.Bvh(umbel.shapes.sphere(1)).save(path)
    whole = path.read_bytes()
    random = np.random.default_rng(18)
    damaged = [b"", whole[:100], whole[:-1], whole + b"\0", b"ply\n" + whole[4:]]
    for _ in range(200):
        copy = bytearray(whole)
        copy[random.integers(len(copy))] ^= 1 << random.integers(8)
        damaged.append(bytes(copy))
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(umbel.Error, match=r"mesh\.umbvh") as refused:
            umbel.Bvh.load(path)
        assert refused.value.code in ("corrupt", "unsupported")
    with pytest.raises(umbel.Error) as missing:
        umbel.Bvh.load(tmp_path / "missing.umbvh")
    assert missing.value.code == "io"
