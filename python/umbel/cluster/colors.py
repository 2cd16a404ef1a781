"""Clusters made visible: a colour each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.cluster.clusters import Clusters, check_triangles
from umbel.geometry.arrays import as_mesh
from umbel.geometry.mesh import Mesh

_GOLDEN = 0.6180339887498949
_SATURATION, _VALUE = 0.55, 0.95


def cluster_colors(count: int) -> NDArray[np.float32]:
    """(count, 4) linear RGBA whose hues turn by the golden ratio, so that neighbours in the
    order differ clearly."""
    hue = (np.arange(count) * _GOLDEN) % 1.0
    offsets = np.array([5.0, 3.0, 1.0])
    k = (offsets + hue[:, None] * 6.0) % 6.0
    rgb = _VALUE * (1 - _SATURATION * np.clip(np.minimum(k, 4.0 - k), 0.0, 1.0))
    return np.hstack([rgb**2.2, np.ones((count, 1))]).astype(np.float32)


def colored_clusters(mesh: Any, clusters: Clusters) -> Mesh:
    """The mesh's triangles in cluster order, with a vertex colour a cluster; vertices on borders
    are split."""
    given = as_mesh(mesh)
    check_triangles(clusters, given)
    counts = clusters.ranges[:, 1].astype(np.int64)
    label = np.repeat(np.arange(len(counts)), counts)
    chosen = np.concatenate(
        [clusters.items[o : o + c] for o, c in clusters.ranges.tolist()] or [clusters.items[:0]]
    )
    corners = given.triangles[chosen].astype(np.int64)
    keys = (label[:, None] * max(len(given.positions), 1) + corners).reshape(-1)
    unique, inverse = np.unique(keys, return_inverse=True)
    vertex, owner = unique % max(len(given.positions), 1), unique // max(len(given.positions), 1)
    return Mesh(
        positions=given.positions[vertex],
        triangles=inverse.reshape(-1, 3).astype(np.uint32),
        normals=None if given.normals is None else given.normals[vertex],
        colors=cluster_colors(len(counts))[owner],
        name=given.name,
        origin=given.origin,
    )
