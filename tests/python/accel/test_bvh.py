"""Hierarchies from Python: how they are built, refitted, saved, and what they refuse."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.hierarchies import ball_rays, random_soup

BUILDERS = umbel.bvh.builders()
Mesh = umbel.Mesh


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
    origins, directions = ball_rays(200, 11)
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


def test_what_is_no_tree_and_no_costs_is_refused(blob: Mesh) -> None:
    for tree in (umbel.Bvh(blob), None, 3):
        with pytest.raises(umbel.Error, match=r"^tree must be a Bvh2 or a KaryTree"):
            umbel.Bvh.from_tree(tree, blob)  # type: ignore[arg-type]
    tree = umbel.build_bvh2(blob)
    for ask in (tree.statistics, tree.sah_cost, tree.epo, umbel.build_kary(blob).sah_cost):
        for wrong in (3, (), (1, 2, 3), "ab", (1, -1), (math.nan, 1), [[1], [2, 3]]):
            with pytest.raises(umbel.Error, match=r"^cost must"):
                ask(wrong)  # type: ignore[arg-type]
    assert tree.sah_cost(np.array([3, 2])) == tree.sah_cost()  # type: ignore[arg-type]
    assert tree.sah_cost((3, 0)) + tree.sah_cost((0, 2)) == pytest.approx(tree.sah_cost())


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
    ("kmeans", {"clusters": 1024}),
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
    soup = random_soup(2000, 0.2)
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
    origins, directions = ball_rays(3000, 12)
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
    for stop in (False, np.False_):  # comparisons with numbers of NumPy give the second
        with pytest.raises(umbel.Cancelled):
            umbel.Bvh(blob, progress=lambda fraction, stage, stop=stop: stop)
    for go_on in (True, np.True_, None, 0):
        umbel.Bvh(blob, progress=lambda fraction, stage, go_on=go_on: go_on)

    def fail(fraction: float, stage: str) -> None:
        raise KeyError(stage)

    with pytest.raises(KeyError):
        umbel.build_bvh2(blob, progress=fail)
    bvh = umbel.Bvh(blob)
    with pytest.raises(umbel.Cancelled):
        bvh.refit(blob.positions, progress=lambda fraction, stage: False)


@pytest.mark.parametrize("make", [umbel.build_bvh2, umbel.bvh.build_kary])
def test_progress_of_a_tree_that_is_taken_is_told(make: Any, blob: Mesh) -> None:
    tree, told = make(blob), []
    umbel.Bvh.from_tree(tree, blob, progress=lambda fraction, stage: told.append(fraction))
    assert told == [0.0, 1.0]
    with pytest.raises(umbel.Cancelled):
        umbel.Bvh.from_tree(tree, blob, progress=lambda fraction, stage: False)


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
    origins, directions = ball_rays(100_000, 13)
    boxes = np.hstack([origins, origins + 0.01])
    tree = umbel.bvh.DynamicTree(boxes)
    # A call that holds the GIL lets the other thread run once or twice, before and after it.
    for work in (
        lambda: umbel.Bvh(mesh, builder="sweep", threads=1),
        lambda: bvh.intersect(origins, directions, threads=1),
        lambda: bvh.all_hits(origins, directions, threads=1),
        lambda: bvh.signed_distance(origins, threads=1),
        lambda: tree.insert(boxes),
        lambda: tree.move(np.arange(len(boxes)), boxes[::-1]),
    ):
        assert max(_runs_beside(work) for _ in range(5)) > 10


def test_threads_may_share_a_hierarchy(bvh: umbel.Bvh) -> None:
    origins, directions = ball_rays(5000, 14)
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
        origins, directions = ball_rays(4)
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
    origins, directions = ball_rays(300, 15)
    hits, expected = bvh.intersect(origins, directions), kept.intersect(origins, directions)
    assert np.array_equal(hits.t, expected.t)
    assert not gone[hits.primitive[hits.hit]].any()
    assert len(bvh) == len(sphere.triangles)
    triangles = sphere.triangles.copy()
    triangles[3, 1] = 100_000
    for invalid in ("refuse", "drop"):
        with pytest.raises(umbel.Error, match="triangle 3"):
            umbel.Bvh(sphere.positions, triangles, builder=builder, invalid=invalid)


BUILD_MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({"builder": "magic"}, "builder is 'magic'"),
    ({"builder": None}, "builder must be a name"),
    ({"builder": "kmeans-q9"}, "q1"),
    ({"builder": "sweep-q1"}, "kmeans"),
    ({"width": 3}, "width must be 2, 4 or 8"),
    ({"width": "8"}, "width must be 2, 4 or 8"),
    ({"width": np.array([4, 8])}, "width must be 2, 4 or 8"),
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
    ({"clusters": 1025}, "kmeans.clusters is 1025"),
    ({"threads": -1}, "threads must be from 0"),
    ({"threads": 1 << 32}, "threads must be from 0"),
]


@pytest.mark.parametrize(
    ("options", "sentence"), BUILD_MISTAKES, ids=[str(o)[:40] for o, _ in BUILD_MISTAKES]
)
def test_mistakes_of_builds_are_sentences(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(umbel.Error, match=sentence):
        umbel.Bvh(umbel.shapes.sphere(1), **options)


def test_a_width_may_be_any_number() -> None:
    for width in (4, 4.0, np.uint8(4), np.array(4)):
        assert umbel.Bvh(umbel.shapes.sphere(1), width=width).statistics()["width"] == 4


def test_options_that_there_are_not_are_type_errors() -> None:
    with pytest.raises(TypeError, match="binz"):
        umbel.Bvh(umbel.shapes.sphere(1), binz=16)
    for wrong in (3, None, "no/such/file.ply", np.zeros((4, 5)), object()):
        with pytest.raises((umbel.Error, OSError)):
            umbel.Bvh(wrong)
