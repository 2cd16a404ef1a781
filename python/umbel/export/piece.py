"""A part of a surface, and how planes cut it. Cutting both ways at a plane gives two parts that fit
to the bit: points on the plane are computed from the ends of the edge that they are on, in the same
order on either side."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from umbel.geometry.mesh import Mesh

Doubles = NDArray[np.float64]
Indices = NDArray[np.uint32]

#: Attributes that have a direction: axes are exchanged in them as in positions.
DIRECTIONS = ("NORMAL", "TANGENT")


@dataclass(frozen=True)
class Piece:
    """Triangles on points in double precision; attributes by their names in glTF."""

    points: Doubles  #: (n, 3)
    triangles: Indices  #: (m, 3)
    materials: Indices | None  #: (m,)
    columns: dict[str, Doubles]  #: (n, k) each

    @staticmethod
    def of(mesh: Mesh) -> Piece:
        """A mesh, relative to its origin. Joints and weights are left out."""
        named = {
            "NORMAL": mesh.normals,
            "TANGENT": mesh.tangents,
            "COLOR_0": mesh.colors,
            **{
                f"TEXCOORD_{k}": uvs
                for k, uvs in enumerate([mesh.uvs, *mesh.uv_sets])
                if uvs is not None
            },
        }
        columns = {k: v.astype(np.float64) for k, v in named.items() if v is not None}
        points = mesh.positions.astype(np.float64)
        return Piece(points, mesh.triangles, mesh.material_ids, columns)

    def turned(self, turn: Doubles) -> Piece:
        """With axes exchanged by a (3, 3) matrix of zeros and ones, with signs."""
        columns = dict(self.columns)
        for name in DIRECTIONS:
            if name in columns:
                columns[name] = columns[name].copy()
                columns[name][:, :3] = columns[name][:, :3] @ turn.T
        return replace(self, points=self.points @ turn.T + 0.0, columns=columns)

    def half(self, axis: int, value: float, upper: bool) -> Piece:
        """What lies above or below a plane across an axis. Triangles within it lie above."""
        signs = np.sign(self.points[:, axis] - value).astype(np.int8)
        if not upper:
            signs = -signs
        if signs.min(initial=1) >= (0 if upper else 1):
            return self
        a, b, c = (signs[self.triangles[:, k]] for k in range(3))
        least, most = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        whole = (least >= 0) if upper else (least >= 0) & (most > 0)
        if whole.all():
            return self
        crossing = np.flatnonzero((least < 0) & (most > 0))
        kept = self._chosen(np.flatnonzero(whole))
        if not len(crossing):
            return kept
        return kept.joined(*self._cut(crossing, signs, axis, value))

    def _chosen(self, which: NDArray[np.intp]) -> Piece:
        materials = None if self.materials is None else self.materials[which]
        return replace(self, triangles=self.triangles[which], materials=materials)

    def joined(
        self,
        points: Doubles,
        columns: dict[str, Doubles],
        triangles: Indices,
        materials: Indices | None,
    ) -> Piece:
        """With further points, and triangles on all points."""
        if materials is not None and self.materials is not None:
            materials = np.concatenate([self.materials, materials])
        return Piece(
            np.concatenate([self.points, points]),
            np.concatenate([self.triangles, triangles]),
            materials,
            {k: np.concatenate([v, columns[k]]) for k, v in self.columns.items()},
        )

    def _cut(
        self, crossing: NDArray[np.intp], signs: NDArray[np.int8], axis: int, value: float
    ) -> tuple[Doubles, dict[str, Doubles], Indices, Indices | None]:
        """New points, and the triangles of the kept parts of those that cross the plane."""
        count = len(self.points)
        corners, owner = _kept_parts(self.triangles[crossing], signs, count)
        new = corners >= count
        edges, number = np.unique(corners[new] - count, return_inverse=True)
        one, other = edges // count, edges % count
        swap = self.points[one, axis] > self.points[other, axis]
        low, high = np.where(swap, other, one), np.where(swap, one, other)
        start, end = self.points[low], self.points[high]
        share = ((value - start[:, axis]) / (end[:, axis] - start[:, axis]))[:, None]
        points = start + (end - start) * share
        points[:, axis] = value
        columns = {k: _between(k, v[low], v[high], share) for k, v in self.columns.items()}
        corners[new] = count + number.reshape(-1)
        materials = None if self.materials is None else self.materials[crossing[owner]]
        return points, columns, corners.astype(np.uint32), materials


def _kept_parts(
    triangles: Indices, signs: NDArray[np.int8], count: int
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Triangles of the parts on the side of positive signs, and which of the given each is from.
    A corner from `count` on is the point where the edge from a kept to a dropped vertex crosses the
    plane: count + kept * count + dropped."""
    sides = signs[triangles]
    is_two = (sides > 0).sum(axis=1) == 2
    # The corner that is alone on its side comes first.
    alone = np.where(is_two, np.argmin(sides, axis=1), np.argmax(sides, axis=1))
    order = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles.astype(np.int64), order, axis=1).T
    _, side_b, side_c = np.take_along_axis(sides, order, axis=1).T
    ab = np.where(side_b < 0, count + a * count + b, b)
    ac = np.where(side_c < 0, count + a * count + c, c)
    ba, ca = count + b * count + a, count + c * count + a
    two = np.flatnonzero(is_two)
    parts = np.stack([np.where(is_two, ba, a), np.where(is_two, b, ab), np.where(is_two, c, ac)], 1)
    more = np.stack([ba, c, ca], axis=1)[two]
    return np.concatenate([parts, more]), np.concatenate([np.arange(len(parts)), two])


def _between(name: str, low: Doubles, high: Doubles, share: Doubles) -> Doubles:
    mixed: Doubles = low + (high - low) * share
    if name == "TANGENT":
        mixed[:, 3] = low[:, 3]
    return mixed
