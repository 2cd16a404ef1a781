"""A mesh that is never whole in memory: any range of its vertices and triangles on demand."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error

Ids = NDArray[np.int64]
Points = NDArray[np.float64]

BLOCK = 1 << 20
"""Triangles of a block, if nobody says otherwise."""


@dataclass
class Block:
    """Some triangles, and the vertices that they use."""

    positions: NDArray[Any]  #: (n, 3) float64 or float32, in the world
    triangles: NDArray[np.uint32]  #: (m, 3), of this block's vertices
    uvs: NDArray[np.float32] | None = None  #: (n, 2)
    materials: NDArray[np.uint32] | None = None  #: (m,)


@dataclass
class Vertices:
    """What vertices have."""

    positions: Points
    uvs: NDArray[np.float32] | None = None

    def __getitem__(self, which: Any) -> Vertices:
        return Vertices(self.positions[which], None if self.uvs is None else self.uvs[which])


class Giant(ABC):
    """A mesh of `triangle_count` triangles over `vertex_count` vertices, both numbered from 0.

    Positions are multiples of 2^-10, so they can be moved by whole numbers without rounding.
    """

    triangle_count: int
    vertex_count: int
    #: triangles of one file of `write_tiles`
    tile_triangles: int = BLOCK
    #: whole numbers near all positions, for formats whose positions are floats
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    material_count: int = 0
    has_uvs: bool = False

    @abstractmethod
    def vertices_of(self, ids: Ids) -> Vertices:
        """Vertices anywhere."""

    @abstractmethod
    def triangles_of(self, ids: Ids) -> Ids:
        """(n, 3) vertices of triangles anywhere."""

    def vertices(self, begin: int, end: int) -> Vertices:
        """The vertices of [begin, end)."""
        return self.vertices_of(np.arange(begin, end))

    def triangles(self, begin: int, end: int) -> Ids:
        """(n, 3) vertices of the triangles of [begin, end)."""
        return self.triangles_of(np.arange(begin, end))

    def materials_of(self, ids: Ids) -> NDArray[np.uint32] | None:
        """Of triangles anywhere; None if `material_count` is 0."""
        return None

    def block(self, begin: int, end: int, dtype: Any = np.float64) -> Block:
        """The triangles of [begin, end), with vertices of their own."""
        ids = self.triangles(begin, end)
        first, last = int(ids.min()), int(ids.max()) + 1
        if last - first <= 2 * ids.size:
            vertices, local = self.vertices(first, last), ids - first
        else:
            unique, inverse = np.unique(ids, return_inverse=True)
            vertices, local = self.vertices_of(unique), inverse.reshape(-1, 3)
        materials = self.materials_of(np.arange(begin, end)) if self.material_count else None
        positions = np.ascontiguousarray(vertices.positions, dtype)
        return Block(positions, local.astype(np.uint32), vertices.uvs, materials)

    def blocks(
        self,
        size: int = BLOCK,
        begin: int = 0,
        end: int | None = None,
        dtype: Any = np.float64,
    ) -> Iterator[Block]:
        """The triangles of [begin, end) in order, `size` at a time. Vertices that blocks share are
        in each of them, equal to the bit."""
        last = self.triangle_count if end is None else end
        if size < 1 or not 0 <= begin <= last <= self.triangle_count:
            raise Error(
                f"blocks of {size} triangles in [{begin}, {last}) of {self.triangle_count} make no "
                "sense"
            )
        for at in range(begin, last, size):
            yield self.block(at, min(at + size, last), dtype)


def on_grid(points: Points) -> Points:
    """Rounded to multiples of 2^-10."""
    points *= 1024.0
    np.rint(points, out=points)
    points *= 1.0 / 1024.0
    return points
