"""Leaves: two triangles each, in crowns on a plane."""

from __future__ import annotations

import numpy as np

from umbel.testing.giant.mesh import Giant, Ids, Points, Vertices, on_grid
from umbel.testing.giant.noise import hashed, unit

_CROWN = 4096  # leaves
_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
_SPACING, _RADIUS, _LEAF = 16.0, 9.0, 0.25


class Foliage(Giant):
    """Leaf k has the vertices 4 k to 4 k + 3; crown k the leaves 4096 k and on."""

    def __init__(self, triangles: int, seed: int, uvs: bool) -> None:
        self.triangle_count = triangles
        self.vertex_count = 4 * (-(-triangles // 2))
        self.has_uvs = uvs
        self._seed = seed
        crowns = -(-triangles // (2 * _CROWN))
        self._crowns_a_row = int(np.ceil(np.sqrt(crowns)))

    def vertices_of(self, ids: Ids) -> Vertices:
        leaf, corner = np.divmod(ids, 4)
        return self._corners(self._leaves(leaf), corner)

    def vertices(self, begin: int, end: int) -> Vertices:
        # Each leaf once, not for each of its corners.
        first, last = begin // 4, -(-end // 4)
        leaves = self._leaves(np.arange(first, last))
        each = tuple(np.repeat(values, 4, axis=0) for values in leaves)
        corners = np.tile(np.arange(4), last - first)
        return self._corners(each, corners)[begin - 4 * first : end - 4 * first]

    def _leaves(self, leaf: Ids) -> tuple[Points, ...]:
        """Where leaves are, and their two directions."""
        crown = leaf // _CROWN
        centre = self._in_ball(leaf, 0) * _RADIUS
        centre[:, 0] += (crown % self._crowns_a_row) * _SPACING
        centre[:, 1] += (crown // self._crowns_a_row) * _SPACING
        centre[:, 2] += 12.0
        along = _directions(self._in_ball(leaf, 1))
        return centre, along, _directions(_cross(along, self._in_ball(leaf, 2)))

    def _corners(self, leaves: tuple[Points, ...], corner: Ids) -> Vertices:
        centre, along, across = leaves
        u, v = (_CORNERS[corner, k, None] for k in range(2))
        points = on_grid(centre + (along * (2.0 * u) + across * v) * _LEAF)
        uvs = ((_CORNERS[corner] + 1.0) / 2.0).astype(np.float32) if self.has_uvs else None
        return Vertices(points, uvs)

    def _in_ball(self, leaf: Ids, which: int) -> Points:
        """A point for each leaf, denser towards the middle."""
        bits = hashed(leaf.astype(np.uint64), self._seed * 64 + which)
        more = hashed(bits, which)
        out = np.empty((len(leaf), 3))
        for axis in range(3):
            out[:, axis] = unit(bits, axis) + unit(more, axis) - 1.0
        return out

    def triangles_of(self, ids: Ids) -> Ids:
        leaf, half = ids >> 1, ids & 1
        first = 4 * leaf
        return np.stack([first, first + 1 + half, first + 2 + half], axis=1)


def _cross(a: Points, b: Points) -> Points:
    out = np.empty_like(a)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[:, k] = a[:, i] * b[:, j] - a[:, j] * b[:, i]
    return out


def _directions(vectors: Points) -> Points:
    x, y, z = vectors.T
    length = np.sqrt(x * x + y * y + z * z)
    out: Points = vectors / np.where(length > 0, length, 1.0)[:, None]
    return out
