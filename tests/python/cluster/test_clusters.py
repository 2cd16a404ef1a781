"""Clusters from Python: every way in, and what must hold of what comes out."""

from __future__ import annotations

import inspect
import pickle
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

import umbel
from umbel import _umbel


@pytest.fixture(scope="module")
def blob() -> umbel.Mesh:
    return umbel.shapes.blob(5)


def assert_partition(clusters: umbel.Clusters, items: int) -> None:
    assert np.array_equal(np.sort(clusters.items), np.arange(items))
    assert clusters.offsets[0] == 0 and clusters.offsets[-1] == items
    assert (np.diff(clusters.offsets.astype(np.int64)) > 0).all()


@pytest.mark.parametrize("preset", ["quality", "fast", "exact"])
@pytest.mark.parametrize("limit", [7, 64, 128, 1000])
def test_every_triangle_is_in_one_cluster(blob: umbel.Mesh, preset: str, limit: int) -> None:
    clusters = umbel.cluster_mesh(blob, max_triangles=limit, preset=preset)
    assert_partition(clusters, len(blob.triangles))
    assert np.diff(clusters.offsets).max() <= limit
    assert clusters.items.dtype == np.uint32 and clusters.offsets.dtype == np.uint32


def test_vertex_limit_is_kept(blob: umbel.Mesh) -> None:
    clusters = umbel.cluster_mesh(blob, max_triangles=128, max_vertices=48)
    for begin, end in zip(clusters.offsets[:-1], clusters.offsets[1:], strict=True):
        assert len(np.unique(blob.triangles[clusters.items[begin:end]])) <= 48
    assert clusters.metrics()["max_vertices"] <= 48


def test_exact_leaves_one_cluster_smaller(blob: umbel.Mesh) -> None:
    sizes = np.diff(umbel.cluster_mesh(blob, max_triangles=100, preset="exact").offsets)
    assert (sizes != 100).sum() <= 1


def test_morton_clusters_are_full_and_larger(blob: umbel.Mesh) -> None:
    bisected = umbel.cluster_mesh(blob)
    morton = umbel.cluster_mesh(blob, method="morton")
    assert_partition(morton, len(blob.triangles))
    assert (np.diff(morton.offsets)[:-1] == 128).all()
    ratio = "surface_area_ratio"
    assert morton.metrics()[ratio] > bisected.metrics()[ratio]


def test_metrics_equal_brute_force(blob: umbel.Mesh) -> None:
    clusters = umbel.cluster_mesh(blob, max_triangles=64)
    metrics = clusters.metrics()

    def area(points: np.ndarray) -> float:
        x, y, z = np.ptp(points.reshape(-1, 3).astype(np.float64), axis=0)
        return 2 * (x * y + y * z + z * x)

    parts = np.split(clusters.items, clusters.offsets[1:-1])
    whole = area(blob.positions[blob.triangles])
    areas = np.array([area(blob.positions[blob.triangles[part]]) for part in parts])
    sizes = np.array([len(part) for part in parts])
    vertices = [len(np.unique(blob.triangles[part])) for part in parts]
    assert metrics["clusters"] == len(parts)
    assert metrics["mean_fill"] == pytest.approx(sizes.sum() / (len(parts) * 64))
    assert (metrics["min_size"], metrics["max_size"]) == (sizes.min(), sizes.max())
    assert metrics["mean_vertices"] == pytest.approx(np.mean(vertices))
    assert metrics["max_vertices"] == max(vertices)
    assert metrics["surface_area_ratio"] == pytest.approx(areas.sum() / whole, rel=1e-4)
    assert metrics["sah"] == pytest.approx((areas * sizes).sum() / whole, rel=1e-4)
    # The same quantity by random lines, so only roughly the same number.
    assert metrics["overlap"] == pytest.approx(metrics["surface_area_ratio"], rel=0.1)


def test_thread_count_changes_nothing(blob: umbel.Mesh) -> None:
    one, two = (umbel.cluster_mesh(blob, threads=n) for n in (1, 2))
    assert np.array_equal(one.items, two.items) and np.array_equal(one.offsets, two.offsets)


def test_meshes_come_in_many_forms(blob: umbel.Mesh, tmp_path) -> None:
    path = tmp_path / "blob.ply"
    umbel.save(path, blob)
    forms = [
        path,
        str(path),
        trimesh.Trimesh(blob.positions, blob.triangles, process=False),
        SimpleNamespace(vertices=blob.positions.tolist(), faces=blob.triangles.tolist()),
        SimpleNamespace(vertices=blob.positions.astype(">f8"), faces=blob.triangles.astype("i8")),
        SimpleNamespace(vertices=np.asfortranarray(blob.positions), faces=blob.triangles[:, ::1]),
    ]
    expected = umbel.cluster_mesh(blob).items
    for form in forms:
        assert np.array_equal(umbel.cluster_mesh(form).items, expected)


def test_build_clusters_of_boxes_keeps_segments_apart() -> None:
    rng = np.random.default_rng(3)
    low = rng.random((1000, 3), np.float32)
    boxes = np.hstack([low, low + np.float32(0.01)])
    segments = np.array([[0, 300], [300, 700]])
    clusters = umbel.build_clusters(boxes, max_items=32, min_items=16, segments=segments)
    assert_partition(clusters, 1000)
    labels = clusters.labels()
    assert not set(labels[:300]) & set(labels[300:])
    assert clusters.segments[:, 1].sum() == len(clusters)
    for (begin, count), (first, _) in zip(clusters.segments.tolist(), segments, strict=True):
        assert clusters.ranges[begin, 0] == first and count > 0


def test_connections_keep_the_connected_together() -> None:
    # Two interleaved families of points on a line; only connections tell them apart.
    x = np.repeat(np.arange(32), 2).astype(np.float32)
    points = np.stack([x, np.tile([0, 1e-3], 32), np.zeros(64)], axis=1).astype(np.float32)
    boxes = np.hstack([points, points])
    family = np.arange(64) % 2
    targets = [np.flatnonzero((family == family[i]) & (np.arange(64) != i)) for i in range(64)]
    offsets = np.concatenate([[0], np.cumsum([len(t) for t in targets])])

    def cost(clusters: umbel.Clusters) -> float:
        return clusters.metrics()["ratio_cut"]

    connections = (offsets, np.concatenate(targets), np.full(offsets[-1], 1e4, np.float32))
    given = umbel.build_clusters(boxes, 32, "exact", connections=connections)
    assert cost(given) == 0
    assert all(len(set(family[part])) == 1 for part in np.split(given.items, [32]))


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"max_triangles": 0}, "max_triangles"),
        ({"max_triangles": 2.5}, "max_triangles"),
        ({"min_triangles": 200}, "min_triangles is 200, more than max_triangles"),
        ({"min_triangles": "a"}, "min_triangles"),
        ({"preset": "best"}, "best"),
        ({"method": "magic"}, "magic"),
        ({"underfill_cost": 2.0}, "underfill"),
        ({"overlap_cost": float("nan")}, "overlap"),
        ({"max_triangles": -1}, "-1"),
        ({"max_vertices": -1}, "max_vertices"),
        ({"shared_vertex_weight": -1.0}, "shared_vertex_weight"),
        ({"shared_vertex_weight": "a"}, "shared_vertex_weight"),
        ({"normal_weight": "a"}, "normal_weight"),
    ],
)
def test_bad_arguments_are_named(blob: umbel.Mesh, arguments: dict, word: str) -> None:
    with pytest.raises(umbel.Error, match=word):
        umbel.cluster_mesh(blob, **arguments)


def test_clusters_are_compared_and_pickled(blob: umbel.Mesh) -> None:
    corners = blob.positions[blob.triangles]
    boxes = np.hstack([corners.min(1), corners.max(1)])
    made = [
        umbel.cluster_mesh(blob),
        umbel.cluster_mesh(blob, normal_weight=1.0),
        umbel.build_clusters(boxes, 64),
    ]
    for clusters in made:
        again = pickle.loads(pickle.dumps(clusters))
        assert again == clusters and again.metrics() == clusters.metrics()
    assert made[0] == umbel.cluster_mesh(blob) and made[0] != made[2] and made[0] != 3


def test_clusters_of_another_mesh_are_refused(blob: umbel.Mesh) -> None:
    clusters = umbel.cluster_mesh(blob)
    for function in (umbel.colored_clusters, umbel.cluster_boxes):
        with pytest.raises(umbel.Error, match="clusters of triangle"):
            function(umbel.shapes.blob(2), clusters)
    longer = replace(clusters, ranges=clusters.ranges + np.uint32([0, 1]))
    with pytest.raises(umbel.Error, match=r"clusters\.ranges"):
        umbel.colored_clusters(blob, longer)


def test_bad_boxes_are_named() -> None:
    boxes = np.zeros((4, 6), np.float32)
    boxes[2, 1] = np.nan
    with pytest.raises(umbel.Error, match="2"):
        umbel.build_clusters(boxes)
    with pytest.raises(umbel.Error, match="shape"):
        umbel.build_clusters(np.zeros((4, 5)))


def test_nothing_makes_no_clusters() -> None:
    empty = umbel.Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.uint32))
    clusters = umbel.cluster_mesh(empty)
    assert len(clusters) == 0 and clusters.offsets.tolist() == [0] and len(clusters.items) == 0
    assert clusters.metrics()["clusters"] == 0
    assert len(umbel.build_clusters(np.zeros((0, 6)))) == 0


def test_coloured_clusters_show_every_triangle(blob: umbel.Mesh) -> None:
    clusters = umbel.cluster_mesh(blob)
    shown = umbel.colored_clusters(blob, clusters)
    assert np.array_equal(
        shown.positions[shown.triangles], blob.positions[blob.triangles[clusters.items]]
    )
    of_triangle = shown.colors[shown.triangles]
    assert (of_triangle == of_triangle[:, :1]).all()
    assert len(np.unique(of_triangle[:, 0], axis=0)) == len(clusters)


def fields_of(bound: type) -> set[str]:
    return {name for name in vars(bound) if not name.startswith("_")}


def test_every_field_of_the_library_can_be_given() -> None:
    config = fields_of(_umbel.ClusterConfig)
    assert {"min_items", "coarse"} <= config
    of_boxes = set(inspect.signature(umbel.build_clusters).parameters)
    assert config <= of_boxes
    given = re.findall(r"(\w+): ", inspect.getdoc(_umbel.ClusterInput.__init__) or "")
    known = set(given) - {"self", "return"}
    assert {"boxes", "segments", "item_vertices"} <= known
    known = {"connections" if name.startswith("connection_") else name for name in known}
    assert known <= of_boxes
    of_mesh = set(inspect.signature(umbel.cluster_mesh).parameters)
    assert {name.replace("_items", "_triangles") for name in config} <= of_mesh
    assert {"shared_vertex_weight", "progress", "threads"} <= of_mesh & of_boxes


@pytest.mark.parametrize(
    "changes",
    [
        {"min_triangles": 100},
        {"underfill_cost": 0.0},
        {"overlap_cost": 1.0},
        {"presplit_threshold": 200},
        {"coarse": True},
        {"shared_vertex_weight": 1.0},
        {"max_vertices": 60},
        {"max_vertices": 40, "vertex_underfill_cost": 0.0},
    ],
)
def test_every_knob_reaches_the_library(blob: umbel.Mesh, changes: dict) -> None:
    without = dict(list(changes.items())[:-1])
    plain = umbel.cluster_mesh(blob, **without)
    turned = umbel.cluster_mesh(blob, **changes)
    assert_partition(turned, len(blob.triangles))
    assert not np.array_equal(plain.items, turned.items)
    # The same through boxes of one's own.
    corners = blob.positions[blob.triangles]
    boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)])
    renamed = {key.replace("_triangles", "_items"): value for key, value in changes.items()}
    own = umbel.build_clusters(boxes, item_vertices=blob.triangles, **renamed)
    assert np.array_equal(own.items, turned.items) and np.array_equal(own.offsets, turned.offsets)
    metrics, own_metrics = turned.metrics(), own.metrics()
    assert own_metrics == pytest.approx(metrics, rel=1e-6)


def test_quads_count_four_vertices_each() -> None:
    size = 24
    rows, columns = np.divmod(np.arange(size * size), size)
    corner = rows * (size + 1) + columns
    quads = np.stack([corner, corner + 1, corner + size + 2, corner + size + 1], axis=1)
    low = np.stack([columns, rows, np.zeros_like(rows)], axis=1).astype(np.float32)
    boxes = np.hstack([low, low + np.float32([1, 1, 0])])
    clusters = umbel.build_clusters(boxes, 64, item_vertices=quads, max_vertices=40, min_items=8)
    parts = np.split(clusters.items, clusters.offsets[1:-1])
    assert max(len(np.unique(quads[part])) for part in parts) <= 40
    assert clusters.metrics()["mean_vertices"] == pytest.approx(
        np.mean([len(np.unique(quads[part])) for part in parts])
    )


def test_given_centroids_decide_where_items_go() -> None:
    boxes = np.zeros((64, 6), np.float32)
    boxes[:, 3:] = 1
    side = np.arange(64) % 2
    centroids = np.stack([side * 10.0, np.zeros(64), np.zeros(64)], axis=1)
    clusters = umbel.build_clusters(boxes, 32, "exact", centroids=centroids)
    assert [set(side[part]) for part in np.split(clusters.items, [32])] == [{0}, {1}]


def test_empty_segments_have_no_clusters_and_gaps_stay() -> None:
    low = np.random.default_rng(5).random((50, 3), np.float32)
    segments = [[0, 0], [10, 20], [30, 0], [40, 10], [50, 0]]
    clusters = umbel.build_clusters(np.hstack([low, low]), 8, segments=np.array(segments))
    assert [int(n == 0) for n in clusters.segments[:, 1]] == [1, 0, 1, 0, 1]
    assert clusters.items[:10].tolist() == list(range(10))
    assert clusters.items[30:40].tolist() == list(range(30, 40))
    with pytest.raises(umbel.Error, match="ranges"):
        _ = clusters.offsets
    labels = clusters.labels()
    assert (labels[[*range(10), *range(30, 40)]] == 0xFFFFFFFF).all()
    assert (labels[10:30] < len(clusters)).all() and (labels[40:] < len(clusters)).all()


def test_no_segments_are_none(blob: umbel.Mesh) -> None:
    boxes = umbel.cluster_boxes(blob, umbel.cluster_mesh(blob, 1, min_triangles=1))
    for none in ([], np.zeros((0, 2), np.uint32)):
        clusters = umbel.build_clusters(boxes, segments=none)
        assert len(clusters) == 0 and clusters.segments.shape == (0, 2)
        assert clusters.items.tolist() == list(range(len(boxes)))
        assert clusters.metrics()["clusters"] == 0
    assert len(umbel.build_clusters(boxes, segments=None)) > 0


def test_boxes_hold_the_items_of_their_clusters_alone(blob: umbel.Mesh) -> None:
    corners = blob.positions[blob.triangles]
    boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)])
    for segments in ([[0, 100], [100, 50]], [[200, 60], [10, 100]], None):
        clusters = umbel.build_clusters(boxes, 32, segments=segments)
        made = umbel.cluster_boxes(blob, clusters)
        assert made.shape == (len(clusters), 6) and made.dtype == np.float32
        for box, (offset, count) in zip(made, clusters.ranges.tolist(), strict=True):
            own = boxes[clusters.items[offset : offset + count]]
            assert np.array_equal(box, np.hstack([own[:, :3].min(axis=0), own[:, 3:].max(axis=0)]))


@pytest.mark.parametrize("wrong", [([0, 0], [0]), 5, np.zeros((2, 3))])
def test_connections_are_three_arrays(wrong: Any) -> None:
    with pytest.raises(umbel.Error, match="connections must be"):
        umbel.build_clusters(np.zeros((1, 6)), connections=wrong)


@pytest.mark.parametrize("way", ["mesh", "boxes", "morton"])
def test_progress_is_told_and_can_cancel(way: str) -> None:
    mesh = umbel.shapes.blob(6)
    corners = mesh.positions[mesh.triangles]
    boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)])

    def build(progress) -> umbel.Clusters:
        if way == "boxes":
            return umbel.build_clusters(boxes, progress=progress)
        return umbel.cluster_mesh(
            mesh, progress=progress, method="morton" if way == "morton" else "bisect"
        )

    told: list[tuple[float, str]] = []
    made = build(lambda fraction, stage: told.append((fraction, stage)))
    fractions = [fraction for fraction, _ in told]
    assert told and fractions == sorted(fractions) and fractions[0] >= 0 and fractions[-1] <= 1
    assert all(stage for _, stage in told) and len(made) > 0
    with pytest.raises(umbel.Cancelled) as caught:
        build(lambda fraction, stage: False)
    assert caught.value.code == "cancelled"

    def explode(fraction: float, stage: str) -> None:
        raise RuntimeError("of one's own")

    with pytest.raises(RuntimeError, match="of one's own"):
        build(explode)


@pytest.mark.parametrize("level", [0, 3])
def test_ordered_clusters_are_the_same_clusters(blob: umbel.Mesh, level: int) -> None:
    clusters = umbel.cluster_mesh(blob, max_vertices=128)
    try:
        made = umbel.order_clusters(blob, clusters, level)
    except umbel.Error as error:
        assert level > 0 and "meshoptimizer" in str(error)
        return
    assert made.corners.shape == (len(blob.triangles), 3) and made.corners.dtype == np.uint8
    assert len(made.vertex_offsets) == len(clusters) + 1
    for c, (begin, end) in enumerate(zip(clusters.offsets[:-1], clusters.offsets[1:], strict=True)):
        assert set(made.items[begin:end]) == set(clusters.items[begin:end])
        own = made.vertices[made.vertex_offsets[c] : made.vertex_offsets[c + 1]]
        assert len(np.unique(own)) == len(own) <= 128
        named = own[made.corners[begin:end]]
        assert np.array_equal(np.sort(named), np.sort(blob.triangles[made.items[begin:end]]))


def test_cluster_bounds_hold_their_triangles(blob: umbel.Mesh) -> None:
    clusters = umbel.cluster_mesh(blob, max_vertices=128)
    bounds = umbel.cluster_bounds(blob, clusters)
    corners = blob.positions[blob.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for c, (begin, end) in enumerate(zip(clusters.offsets[:-1], clusters.offsets[1:], strict=True)):
        own = clusters.items[begin:end]
        distances = np.linalg.norm(corners[own] - bounds.centers[c], axis=2)
        assert distances.max() <= bounds.radii[c] * (1 + 1e-6)
        if bounds.cone_cutoffs[c] < 1:
            cosine = np.sqrt(1 - float(bounds.cone_cutoffs[c]) ** 2)
            assert (normals[own] @ bounds.cone_axes[c] >= cosine - 1e-5).all()


def test_order_and_bounds_name_what_is_wrong(blob: umbel.Mesh) -> None:
    large = umbel.cluster_mesh(blob, max_triangles=1000)
    with pytest.raises(umbel.Error, match="512"):
        umbel.order_clusters(blob, large)
    with pytest.raises(umbel.Error, match="512"):
        umbel.cluster_bounds(blob, large)
    with pytest.raises(umbel.Error):
        umbel.order_clusters(umbel.shapes.blob(2), umbel.cluster_mesh(blob, max_vertices=128))


def test_vertex_bits_limit_clusters_as_vertex_indices_do(blob: umbel.Mesh) -> None:
    triangles = blob.triangles
    low = blob.positions[triangles].min(axis=1)
    boxes = np.hstack([low, blob.positions[triangles].max(axis=1)])
    users: dict[int, list[int]] = {}
    for t, corners in enumerate(triangles.tolist()):
        for v in corners:
            users.setdefault(v, []).append(t)
    offsets, targets, bits = [0], [], []
    for t, corners in enumerate(triangles.tolist()):
        shared: dict[int, int] = {}
        for k, v in enumerate(corners):
            for other in users[v]:
                if other != t:
                    shared[other] = shared.get(other, 0) | 1 << k
        targets += shared.keys()
        bits += shared.values()
        offsets.append(len(targets))
    # Beside bits, connections without weights only count vertices.
    links = (offsets, targets, np.ones(len(targets), np.float32))
    by_bits = umbel.build_clusters(
        boxes,
        connections=links,
        connection_vertex_bits=bits,
        vertices_per_item=3,
        max_vertices=48,
    )
    by_indices = umbel.build_clusters(
        boxes, connections=links, item_vertices=triangles, max_vertices=48
    )
    assert np.array_equal(by_bits.items, by_indices.items)
    assert np.array_equal(by_bits.ranges, by_indices.ranges)
    with pytest.raises(umbel.Error, match="vertices_per_item"):
        umbel.build_clusters(boxes, connections=links, connection_vertex_bits=bits)
    with pytest.raises(umbel.Error, match="byte"):
        umbel.build_clusters(boxes, connections=links, connection_vertex_bits=[256] * len(bits))
