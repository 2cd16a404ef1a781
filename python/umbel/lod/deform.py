"""Levels of detail of meshes that deform: bounds that hold in every pose.

The DAG of the rest pose stays; its spheres, boxes and errors are made to hold wherever the vertices
go, so that cuts of any pose have no holes and cull nothing that can be seen.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel.errors import Error
from umbel.geometry.arrays import numbers
from umbel.geometry.mesh import Mesh
from umbel.lod.lod import Lod
from umbel.lod.tables import NONE, Tables

_SPHERE_MARGIN = 1e-4
_ERROR_MARGIN = 1e-5


def deforming_tables(lod: Lod, mesh: Mesh, poses: Iterable[ArrayLike | Mesh]) -> Tables:
    """The tables of `lod` with bounds over the rest pose and all poses.

    mesh: what `lod` was built from, in the pose that it was built in.
    poses: (v, 3) positions of the mesh's vertices in the world each, or meshes, in any number; they
        are read once.

    A group's sphere contains its vertices in every pose, and a cluster's box too. Errors grow by
    what edges of the group's clusters are stretched at most; they say nothing of poses in between.
    Vertices at one position in the rest pose are taken together. Raises where the levels have
    positions that the mesh has not, as with `precision`, with `keep_area` where it enlarged small
    parts, or with a decimation that adds vertices.
    """
    moving = _Moving(lod, mesh)
    moving.add(mesh.world_positions)
    for pose in poses:
        moving.add(pose.world_positions if isinstance(pose, Mesh) else pose)
    return moving.tables()


class _Moving:
    def __init__(self, lod: Lod, mesh: Mesh) -> None:
        self.lod = lod
        rest = np.asarray(mesh.positions, np.float32) + np.float32(0)
        ids: dict[bytes, int] = {}
        self.id_of = np.array([ids.setdefault(p.tobytes(), len(ids)) for p in rest], np.int64)
        self.count = len(ids)
        self.vertices: list[NDArray[np.int64]] = []  # of each cluster, as ids
        self.edges: list[NDArray[np.int64]] = []
        for cluster in range(len(lod.clusters)):
            part = lod.mesh([cluster])
            rows = part.positions.astype(np.float32) + np.float32(0)
            try:
                local = np.array([ids[p.tobytes()] for p in rows], np.int64)
            except KeyError:
                raise Error(
                    "the levels of detail have positions that the mesh has not: "
                    "build them with keep_area=False and without a precision"
                ) from None
            self.vertices.append(local)
            corners = local[part.triangles.astype(np.int64)]
            self.edges.append(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2))
        self.low = np.full((self.count, 3), np.inf)
        self.high = np.full((self.count, 3), -np.inf)
        self.stretch = np.ones(len(lod.clusters))
        self.lengths: list[NDArray[np.float64]] = []

    def add(self, positions: ArrayLike) -> None:
        pose = numbers("a pose", positions).astype(np.float64)
        if pose.shape != (len(self.id_of), 3) or not np.isfinite(pose).all():
            raise Error(f"a pose must be {len(self.id_of)} finite positions, not {pose.shape}")
        if self.lod.origin.any():
            pose -= self.lod.origin
        low = np.full((self.count, 3), np.inf)
        high = np.full((self.count, 3), -np.inf)
        np.minimum.at(low, self.id_of, pose)
        np.maximum.at(high, self.id_of, pose)
        self.low = np.minimum(self.low, low)
        self.high = np.maximum(self.high, high)
        middle = (low + high) / 2
        for cluster, edges in enumerate(self.edges):
            length = np.linalg.norm(middle[edges[:, 0]] - middle[edges[:, 1]], axis=1)
            if len(self.lengths) <= cluster:
                self.lengths.append(length)
            rest = self.lengths[cluster]
            known = rest > 0
            if known.any():
                most = float((length[known] / rest[known]).max())
                self.stretch[cluster] = max(self.stretch[cluster], most)

    def tables(self) -> Tables:
        old = self.lod.tables
        groups, clusters, nodes = old.groups.copy(), old.clusters.copy(), old.nodes.copy()
        for c, vertices in enumerate(self.vertices):
            clusters["box_min"][c] = _down(self.low[vertices].min(axis=0))
            clusters["box_max"][c] = _up(self.high[vertices].max(axis=0))
        for g in range(len(groups)):  # generating groups come first
            first = int(groups["cluster_offset"][g])
            members = range(first, first + int(groups["cluster_count"][g]))
            vertices = np.unique(np.concatenate([self.vertices[c] for c in members]))
            below = np.unique(clusters["generating_group"][list(members)])
            below = below[below != NONE]
            center = _middle(self.low[vertices].min(axis=0), self.high[vertices].max(axis=0))
            radius = _farthest(center, self.low[vertices], self.high[vertices])
            radius = max(radius, _reach(center, groups["center"][below], groups["radius"][below]))
            groups["center"][g] = center
            groups["radius"][g] = _up(radius * (1 + _SPHERE_MARGIN))
            stretch = max(self.stretch[c] for c in members)
            error = float(groups["error"][g]) * stretch
            if len(below):
                error = max(error, float(groups["error"][below].max()) * (1 + _ERROR_MARGIN))
            groups["error"][g] = _up(error)
        for n in _children_first(nodes):
            group, begin = int(nodes["group"][n]), int(nodes["child_offset"][n])
            if group != NONE:
                for name in ("center", "radius", "error"):
                    nodes[name][n] = groups[name][group]
                continue
            inside = slice(begin, begin + int(nodes["child_count"][n]))
            centers, radii = nodes["center"][inside], nodes["radius"][inside]
            wide = radii[:, None].astype(np.float64)
            center = _middle((centers - wide).min(axis=0), (centers + wide).max(axis=0))
            nodes["center"][n] = center
            nodes["radius"][n] = _up(_reach(center, centers, radii) * (1 + _SPHERE_MARGIN))
            nodes["error"][n] = _up(float(nodes["error"][inside].max()) * (1 + _ERROR_MARGIN))
        return Tables.of_arrays(old.levels, groups, clusters, nodes, old.origin)


def _children_first(nodes: NDArray[Any]) -> list[int]:
    order, waiting = [], [0] if len(nodes) else []
    while waiting:
        n = waiting.pop()
        order.append(n)
        begin = int(nodes["child_offset"][n])
        waiting += range(begin, begin + int(nodes["child_count"][n]))
    return order[::-1]


def _middle(low: NDArray[Any], high: NDArray[Any]) -> NDArray[np.float32]:
    return np.asarray((low + high) / 2, np.float32)


def _farthest(center: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> float:
    """From the centre to the boxes in which the vertices move."""
    away = np.maximum(np.abs(low - center), np.abs(high - center))
    return float(np.linalg.norm(away, axis=1).max(initial=0.0))


def _reach(center: NDArray[Any], centers: NDArray[Any], radii: NDArray[Any]) -> float:
    """From the centre to the far side of the spheres."""
    way = np.linalg.norm(centers.astype(np.float64) - center.astype(np.float64), axis=1)
    return float((way + radii).max(initial=0.0))


def _up(value: Any) -> Any:
    return np.nextafter(np.asarray(value, np.float32), np.float32(np.inf))


def _down(value: Any) -> Any:
    return np.nextafter(np.asarray(value, np.float32), np.float32(-np.inf))


__all__ = ["deforming_tables"]
