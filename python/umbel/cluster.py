"""Spatial clusters of triangles, or of any items that have boxes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _umbel
from .arrays import as_mesh, indices, native, rows
from .errors import Error
from .repair import Progress

METHODS = ("bisect", "morton")


@dataclass(frozen=True)
class Clusters:
    """Items in cluster order, and where each cluster begins."""

    items: NDArray[np.uint32]
    """(m,) a permutation of the item indices."""
    ranges: NDArray[np.uint32]
    """(k, 2) offset and count in `items` of each cluster."""
    segments: NDArray[np.uint32]
    """(s, 2) offset and count in `ranges` of each segment."""
    _measure: Callable[[], dict[str, Any]] = field(repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.ranges)

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
        max_vertices surface_area_ratio sah overlap ratio_cut`, as docs/cli.md defines them."""
        return self._measure()


def _config(preset: str, max_items: int, changes: dict[str, Any]) -> _umbel.ClusterConfig:
    if isinstance(max_items, bool) or not 0 <= max_items <= 0xFFFFFFFF:
        raise Error(f"the most items of a cluster cannot be {max_items}")
    config = _umbel.cluster_preset(preset, max_items)
    for key, value in changes.items():
        if value is None:
            continue
        try:
            setattr(config, key, value)
        except TypeError:
            raise Error(f"{key} cannot be {value!r}") from None
    return config


def cluster_mesh(
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
    method: str = "bisect",
    progress: Progress | None = None,
    threads: int = 0,
) -> Clusters:
    """Clusters of at most `max_triangles` triangles of a mesh, a path, or anything with
    .vertices and .faces.

    max_vertices: most unique vertices a cluster; 0 for no limit.
    preset: "quality" (lowest area), "fast", or "exact" (all clusters full but one). What it says
        is overridden by min_triangles, underfill_cost, overlap_cost, vertex_underfill_cost
        (prices in [0, 1]), presplit_threshold (larger nodes are split without a sweep) and coarse
        (some thirty positions an axis are tried instead of all).
    shared_vertex_weight: what a vertex shared by two triangles weighs as a connection that a cut
        would break; 0 for no connections.
    method: "bisect", or "morton": the fastest, with three to four times the area, where only
        max_triangles counts.
    """
    if method not in METHODS:
        raise Error(f"method must be {' or '.join(map(repr, METHODS))}, not {method!r}")
    config = _config(
        preset,
        max_triangles,
        {
            "min_items": min_triangles,
            "max_vertices": max_vertices,
            "underfill_cost": underfill_cost,
            "overlap_cost": overlap_cost,
            "vertex_underfill_cost": vertex_underfill_cost,
            "presplit_threshold": presplit_threshold,
            "coarse": coarse,
        },
    )
    arrays = native(as_mesh(mesh))
    if method == "morton":
        made = _umbel.cluster_mesh_morton(arrays, config, progress, threads)
    else:
        made = _umbel.cluster_mesh(arrays, config, shared_vertex_weight, progress, threads)

    def measure() -> dict[str, Any]:
        return _umbel.mesh_cluster_metrics(
            arrays, made[0], made[1], max_triangles, shared_vertex_weight, threads
        )

    return Clusters(*made, measure)


def build_clusters(
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
        targets[offsets[i]:offsets[i + 1]], with those weights (None: all 1). Should be symmetric.
    item_vertices: (n, v) vertex indices of each item, which max_vertices and
        shared_vertex_weight need.
    segments: (s, 2) offset and count of item ranges that are clustered each by itself.
    The limits and prices are those of `cluster_mesh`.
    """
    config = _config(
        preset,
        max_items,
        {
            "min_items": min_items,
            "max_vertices": max_vertices,
            "underfill_cost": underfill_cost,
            "overlap_cost": overlap_cost,
            "vertex_underfill_cost": vertex_underfill_cost,
            "presplit_threshold": presplit_threshold,
            "coarse": coarse,
        },
    )
    given = _umbel.ClusterInput(
        rows("boxes", boxes, 6),
        centroids=None if centroids is None else rows("centroids", centroids, 3),
        item_vertices=None if item_vertices is None else _vertices(item_vertices),
        shared_vertex_weight=shared_vertex_weight,
        segments=None if segments is None else indices("segments", segments, 2),
        **_connection_arrays(connections),
    )
    made = _umbel.build_clusters(given, config, progress, threads)

    def measure() -> dict[str, Any]:
        return _umbel.cluster_metrics(given, made[0], made[1], max_items)

    return Clusters(*made, measure)


def _vertices(item_vertices: ArrayLike) -> NDArray[np.uint32]:
    array = np.asarray(item_vertices)
    if array.ndim != 2 or array.shape[1] == 0:
        raise Error(f"item_vertices must have shape (n, v), not {array.shape}")
    return indices("item_vertices", array, array.shape[1])


def _connection_arrays(
    connections: tuple[ArrayLike, ArrayLike, ArrayLike | None] | None,
) -> dict[str, Any]:
    if connections is None:
        return {}
    offsets, targets, weights = connections
    starts = indices("connections: offsets", offsets)
    if len(starts) < 1 or (starts[1:] < starts[:-1]).any():
        raise Error("connections: offsets must be one more than the items, and never fall")
    return {
        "connection_ranges": np.stack([starts[:-1], np.diff(starts)], axis=1),
        "connection_targets": indices("connections: targets", targets),
        "connection_weights": None
        if weights is None
        else np.ascontiguousarray(weights, dtype=np.float32).reshape(-1),
    }
