"""Spatial clusters of triangles, or of any items that have boxes."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import (
    about,
    as_mesh,
    configure,
    indices,
    native,
    number,
    numbers,
    rows,
    thread_count,
    whole,
)
from umbel.geometry.arrays import rows as array_rows
from umbel.geometry.mesh import Mesh
from umbel.geometry.repair import Progress

METHODS = ("bisect", "morton", "hybrid")


@dataclass(frozen=True, eq=False)
class Clusters:
    """Items in cluster order, and where each cluster begins. Pickled with what `metrics` needs."""

    items: NDArray[np.uint32]
    """(m,) a permutation of the item indices."""
    ranges: NDArray[np.uint32]
    """(k, 2) offset and count in `items` of each cluster."""
    segments: NDArray[np.uint32]
    """(s, 2) offset and count in `ranges` of each segment."""
    _measure: Callable[[], dict[str, Any]] = field(repr=False)

    def __len__(self) -> int:
        return len(self.ranges)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Clusters):
            return NotImplemented
        return all(
            np.array_equal(getattr(self, name), getattr(other, name))
            for name in ("items", "ranges", "segments")
        )

    @property
    def offsets(self) -> NDArray[np.uint32]:
        """(k + 1,) cluster i is items[offsets[i]:offsets[i + 1]]."""
        if not len(self.ranges):
            return np.zeros(1, np.uint32)
        ends = self.ranges[:, 0] + self.ranges[:, 1]
        if not np.array_equal(ends[:-1], self.ranges[1:, 0]):
            raise Error("segments leave items out between clusters: use `ranges`, not `offsets`")
        return np.append(self.ranges[:, 0], ends[-1:])

    def labels(self) -> NDArray[np.uint32]:
        """(m,) the cluster of each item; 0xffffffff for an item in no segment."""
        labels = np.full(len(self.items), 0xFFFFFFFF, np.uint32)
        for cluster, (offset, count) in enumerate(self.ranges.tolist()):
            labels[self.items[offset : offset + count]] = cluster
        return labels

    def metrics(self) -> dict[str, Any]:
        """How good the clusters are: `clusters mean_fill min_size max_size mean_vertices
        max_vertices surface_area_ratio sah overlap ratio_cut`, as docs/cli.md defines them.
        Measured now, on the arrays that were clustered: they must be as they were."""
        return self._measure()


def _config(preset: str, max_items: int, **changes: Any) -> _umbel.ClusterConfig:
    config = _umbel.cluster_preset(str(preset), whole("max_items", max_items))
    configure(config, changes)
    return config


@contextlib.contextmanager
def _items_are_triangles() -> Iterator[None]:
    """Refusals name arguments as functions for meshes do."""
    try:
        yield
    except Error as error:
        error.args = (re.sub(r"\b(max|min)_items\b", r"\1_triangles", str(error)),)
        raise


def cluster_mesh(
    # Long: every setting is named and described here.
    mesh: Any,
    max_triangles: int = 128,
    max_vertices: int = 0,
    preset: str = "quality",
    *,
    min_triangles: int | None = None,
    underfill_cost: float | None = None,
    overlap_cost: float | None = None,
    vertex_underfill_cost: float | None = None,
    presplit_threshold: int | None = None,
    coarse: bool | None = None,
    shared_vertex_weight: float = 0.0,
    normal_weight: float = 0.0,
    method: str = "bisect",
    progress: Progress | None = None,
    threads: int = 0,
) -> Clusters:
    """Clusters of at most `max_triangles` triangles of a mesh, a path, or anything with
    .vertices and .faces.

    max_vertices: most unique vertices a cluster; 0 for no limit.
    preset: "quality" (lowest area), "fast", or "exact" (all clusters full but one). What it says
        is overridden by min_triangles, underfill_cost, overlap_cost, vertex_underfill_cost
        (penalties in [0, 1]), presplit_threshold (larger nodes are split without a sweep) and
        coarse (groups of neighbours are split instead of triangles).
    shared_vertex_weight: what a vertex shared by two triangles weighs as a connection that a cut
        would break; 0 for no connections.
    normal_weight: what an edge between two triangles weighs, times the cosine of the angle between
        their normals: clusters then end at creases, and bend less. Edges are found by vertex
        indices: weld what is not.
    method: "bisect", or "morton": the fastest, with three to four times the area, where only
        max_triangles counts; or "hybrid": between them in time, and nearly as good as "bisect",
        where max_triangles (up to 512), min_triangles and max_vertices count.
    """
    if method not in METHODS:
        raise Error(f"method must be {' or '.join(map(repr, METHODS))}, not {method!r}")
    weight = number("shared_vertex_weight", shared_vertex_weight)
    with _items_are_triangles():
        config = _config(
            preset,
            max_triangles,
            min_items=min_triangles,
            max_vertices=max_vertices,
            underfill_cost=underfill_cost,
            overlap_cost=overlap_cost,
            vertex_underfill_cost=vertex_underfill_cost,
            presplit_threshold=presplit_threshold,
            coarse=coarse,
        )
    normal_weight = number("normal_weight", normal_weight)
    if normal_weight and method != "bisect":
        raise Error(f"normal_weight is for the method 'bisect', not {method!r}")
    given = as_mesh(mesh)
    arrays = native(given)
    with about(given), _items_are_triangles():
        if normal_weight:
            return _by_normals(given, config, weight, normal_weight, progress, threads)
        if method == "morton":
            made = _umbel.cluster_mesh_morton(arrays, config, progress, thread_count(threads))
        elif method == "hybrid":
            made = _umbel.cluster_mesh_hybrid(arrays, config, progress, thread_count(threads))
        else:
            made = _umbel.cluster_mesh(arrays, config, weight, progress, thread_count(threads))
    return _measured(given, made, max_triangles, weight, threads)


def clusters_of(
    mesh: Any, items: Any, offsets: Any, max_triangles: int = 128, *, threads: int = 0
) -> Clusters:
    """Clusters of a mesh that were made elsewhere, as on a device: cluster i is
    items[offsets[i]:offsets[i + 1]]."""
    starts = indices("offsets", offsets)
    ranges = np.stack([starts[:-1], np.diff(starts)], axis=1)
    segments = np.array([[0, len(ranges)]], np.uint32)
    made = (indices("items", items), ranges, segments)
    return _measured(as_mesh(mesh), made, max_triangles, 0.0, threads)


def _measured(
    mesh: Mesh, made: tuple[Any, Any, Any], max_triangles: int, weight: float, threads: int
) -> Clusters:
    arrays = (mesh.positions, mesh.triangles)
    how = (max_triangles, weight, thread_count(threads))
    return Clusters(*made, partial(_mesh_metrics, arrays, *made[:2], *how))


def _mesh_metrics(arrays: tuple[Any, Any], *how: Any) -> dict[str, Any]:
    return _umbel.mesh_cluster_metrics(native(Mesh(*arrays)), *how)


def _metrics(arrays: dict[str, Any], *how: Any) -> dict[str, Any]:
    return _umbel.cluster_metrics(_umbel.ClusterInput(**arrays), *how)


def _by_normals(
    mesh: Any,
    config: Any,
    shared_vertex_weight: float,
    normal_weight: float,
    progress: Progress | None,
    threads: int,
) -> Clusters:
    from umbel.cluster.weights import normal_connections

    if not 0 <= normal_weight < np.inf:
        raise Error(f"normal_weight must be a number of at least 0, not {normal_weight}")
    # Checks the mesh, and measures the clusters in the end.
    arrays = native(mesh)
    _umbel.cluster_mesh_morton(arrays, config, None, thread_count(threads))
    corners = mesh.positions[mesh.triangles]
    given = {
        "boxes": rows("boxes", np.hstack([corners.min(axis=1), corners.max(axis=1)]), 6),
        "item_vertices": indices("triangles", mesh.triangles, 3),
        "shared_vertex_weight": shared_vertex_weight,
        **_connection_arrays(normal_connections(mesh.positions, mesh.triangles, normal_weight)),
    }
    return _built(given, config, progress, threads)


def _built(
    arrays: dict[str, Any], config: Any, progress: Progress | None, threads: int
) -> Clusters:
    segments = arrays.get("segments")
    none = segments is not None and not len(segments)
    if none:  # for the library that would be one of everything
        arrays = {**arrays, "segments": np.zeros((1, 2), np.uint32)}
    given = _umbel.ClusterInput(**arrays)
    items, ranges, made = _umbel.build_clusters(given, config, progress, thread_count(threads))
    measure = partial(_metrics, arrays, items, ranges, config.max_items)
    return Clusters(items, ranges, made[:0] if none else made, measure)


@dataclass(frozen=True)
class Meshlets:
    """Clusters as mesh shaders and rasterisers take them."""

    items: NDArray[np.uint32]
    """(m,) Clusters.items with the triangles of each cluster in their new order; the clusters'
    ranges hold as they are."""
    vertex_offsets: NDArray[np.uint32]
    """(k + 1,) cluster i has vertices[vertex_offsets[i]:vertex_offsets[i + 1]]."""
    vertices: NDArray[np.uint32]
    """Mesh vertices, in the order in which triangles use them."""
    corners: NDArray[np.uint8]
    """(m, 3) corners of each triangle, as indices into its cluster's vertices."""


@dataclass(frozen=True)
class ClusterBounds:
    """What clusters can be culled by, relative to their mesh's origin. Seen from e, a cluster faces
    away as a whole where dot(normalize(cone_apex - e), cone_axis) >= cone_cutoff."""

    centers: NDArray[np.float32]
    """(k, 3) of spheres that contain all of a cluster's triangles."""
    radii: NDArray[np.float32]
    """(k,)"""
    cone_apexes: NDArray[np.float32]
    """(k, 3) behind every triangle."""
    cone_axes: NDArray[np.float32]
    """(k, 3) of unit length: where the triangles face; zero if there is no such cone."""
    cone_cutoffs: NDArray[np.float32]
    """(k,) sine of the cone's half angle, and a little; 1 if there is no cone."""

    @staticmethod
    def of_rows(rows: NDArray[np.float32]) -> ClusterBounds:
        """From (k, 11) centre, radius, cone apex, axis and cutoff."""
        columns = np.split(array_rows("rows", rows, 11), [3, 4, 7, 10], axis=1)
        return ClusterBounds(columns[0], columns[1][:, 0], columns[2], columns[3], columns[4][:, 0])

    def rows(self) -> NDArray[np.float32]:
        """What `of_rows` takes."""
        columns = [
            array_rows("centers", self.centers, 3),
            array_rows("radii", np.reshape(self.radii, (-1, 1)), 1),
            array_rows("cone_apexes", self.cone_apexes, 3),
            array_rows("cone_axes", self.cone_axes, 3),
            array_rows("cone_cutoffs", np.reshape(self.cone_cutoffs, (-1, 1)), 1),
        ]
        if len({len(column) for column in columns}) != 1:
            raise Error("the arrays of cluster bounds must have one row a cluster")
        return np.hstack(columns)


def order_clusters(
    mesh: Any,
    clusters: Clusters,
    level: int = 0,
    *,
    progress: Progress | None = None,
    threads: int = 0,
) -> Meshlets:
    """The triangles and vertices of each cluster in an order for vertex reuse and rasterisation.
    Clusters may have up to 256 vertices and 512 triangles.

    level: at 0 triangles keep their corner order; 1 to 9 try harder to make what is stored
        compress well (3 is a good value), and may rotate corners.
    """
    arrays = native(as_mesh(mesh))
    return Meshlets(
        *_umbel.order_clusters(
            arrays, *_given(clusters), whole("level", level), progress, thread_count(threads)
        )
    )


def _given(clusters: Clusters) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Items and ranges, which a caller may have made."""
    return (
        indices("clusters.items", clusters.items),
        indices("clusters.ranges", clusters.ranges, 2),
    )


def check_triangles(clusters: Clusters, mesh: Mesh) -> None:
    """Raises where clusters have triangles that the mesh does not have."""
    items, ranges = _given(clusters)
    if len(items) and int(items.max()) >= len(mesh.triangles):
        raise Error(f"clusters of triangle {items.max()}, and there are {len(mesh.triangles)}")
    if len(ranges) and int(ranges.sum(axis=1, dtype=np.uint64).max()) > len(items):
        raise Error(f"clusters.ranges lead beyond the {len(items)} items")


def cluster_boxes(mesh: Any, clusters: Clusters) -> NDArray[np.float32]:
    """(k, 6) the boxes of clusters of a mesh's triangles: least and greatest corners, relative to
    the mesh's origin."""
    source = as_mesh(mesh)
    check_triangles(clusters, source)
    if not len(clusters):
        return np.zeros((0, 6), np.float32)
    begins, sizes = clusters.ranges.astype(np.int64).T
    starts = np.cumsum(sizes) - sizes
    # Segments may be in any order, and leave items out.
    places = np.arange(sizes.sum()) + np.repeat(begins - starts, sizes)
    corners = source.positions[source.triangles[clusters.items[places]]]
    low = np.minimum.reduceat(corners.min(axis=1), starts)
    high = np.maximum.reduceat(corners.max(axis=1), starts)
    return np.hstack([low, high]).astype(np.float32, copy=False)


def cluster_bounds(
    mesh: Any, clusters: Clusters, *, progress: Progress | None = None, threads: int = 0
) -> ClusterBounds:
    """Bounding sphere and normal cone of each cluster, for culling. Clusters as for
    `order_clusters`."""
    arrays = native(as_mesh(mesh))
    return ClusterBounds.of_rows(
        _umbel.cluster_bounds(arrays, *_given(clusters), progress, thread_count(threads))
    )


def build_clusters(
    # Long: every setting is named and described here.
    boxes: ArrayLike,
    max_items: int = 128,
    preset: str = "quality",
    *,
    min_items: int | None = None,
    max_vertices: int = 0,
    underfill_cost: float | None = None,
    overlap_cost: float | None = None,
    vertex_underfill_cost: float | None = None,
    presplit_threshold: int | None = None,
    coarse: bool | None = None,
    centroids: ArrayLike | None = None,
    connections: tuple[ArrayLike, ArrayLike, ArrayLike | None] | None = None,
    connection_vertex_bits: ArrayLike | None = None,
    vertices_per_item: int = 0,
    item_vertices: ArrayLike | None = None,
    shared_vertex_weight: float = 0.0,
    segments: ArrayLike | None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> Clusters:
    """Clusters of any items that have boxes.

    boxes: (n, 6) min x, y, z, max x, y, z of each item.
    centroids: (n, 3); the boxes' centres where None.
    connections: (offsets, targets, weights): item i is connected to
        targets[offsets[i]:offsets[i + 1]], with those weights (None: all 1, or all 0 beside
        connection_vertex_bits). Should be symmetric.
    connection_vertex_bits: one byte a target, with vertices_per_item from 1 to 8: bit k is set
        where vertex k of the item is one of the target's as well. For max_vertices where vertices
        have no indices; all pairs that share a vertex must be connected, in both directions.
    item_vertices: (n, v) vertex indices of each item, which max_vertices and
        shared_vertex_weight need.
    segments: (s, 2) offset and count of item ranges that are clustered each by itself; all items
        are one where None.
    The limits and penalties are those of `cluster_mesh`.
    """
    config = _config(
        preset,
        max_items,
        min_items=min_items,
        max_vertices=max_vertices,
        underfill_cost=underfill_cost,
        overlap_cost=overlap_cost,
        vertex_underfill_cost=vertex_underfill_cost,
        presplit_threshold=presplit_threshold,
        coarse=coarse,
    )
    given = {
        "boxes": rows("boxes", boxes, 6),
        "centroids": None if centroids is None else rows("centroids", centroids, 3),
        "item_vertices": None if item_vertices is None else _vertices(item_vertices),
        "shared_vertex_weight": number("shared_vertex_weight", shared_vertex_weight),
        "segments": None if segments is None else indices("segments", segments, 2),
        "connection_vertex_bits": _bits(connection_vertex_bits),
        "vertices_per_item": whole("vertices_per_item", vertices_per_item),
        **_connection_arrays(connections),
    }
    return _built(given, config, progress, threads)


def _bits(connection_vertex_bits: ArrayLike | None) -> NDArray[np.uint8] | None:
    if connection_vertex_bits is None:
        return None
    bits = indices("connection_vertex_bits", connection_vertex_bits)
    if (bits > 0xFF).any():
        raise Error(f"connection_vertex_bits holds {bits.max()}, more than a byte")
    return bits.astype(np.uint8)


def _vertices(item_vertices: ArrayLike) -> NDArray[np.uint32]:
    array = numbers("item_vertices", item_vertices)
    if array.ndim != 2 or array.shape[1] == 0:
        raise Error(f"item_vertices must have shape (n, v), not {array.shape}")
    return indices("item_vertices", array, array.shape[1])


def _connection_arrays(
    connections: tuple[ArrayLike, ArrayLike, ArrayLike | None] | None,
) -> dict[str, Any]:
    if connections is None:
        return {}
    if not isinstance(connections, (tuple, list)) or len(connections) != 3:
        raise Error(f"connections must be (offsets, targets, weights), not {connections!r:.80}")
    offsets, targets, weights = connections
    starts = indices("connections: offsets", offsets)
    if len(starts) < 1 or (starts[1:] < starts[:-1]).any():
        raise Error("connections: offsets must be one more than the items, and never fall")
    return {
        "connection_ranges": np.stack([starts[:-1], np.diff(starts)], axis=1),
        "connection_targets": indices("connections: targets", targets),
        "connection_weights": None
        if weights is None
        else np.ascontiguousarray(numbers("connections: weights", weights), np.float32).reshape(-1),
    }
