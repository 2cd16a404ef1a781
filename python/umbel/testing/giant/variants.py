"""The same mesh, told otherwise: in random order, or with three vertices a triangle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from umbel.testing.giant.mesh import Giant, Ids, Vertices
from umbel.testing.giant.noise import hashed

_ROUNDS = 4


class _Variant(Giant):
    def __init__(self, mesh: Giant) -> None:
        self._mesh = mesh
        self.triangle_count, self.vertex_count = mesh.triangle_count, mesh.vertex_count
        self.tile_triangles, self.origin = mesh.tile_triangles, mesh.origin
        self.material_count, self.has_uvs = mesh.material_count, mesh.has_uvs


class Shuffled(_Variant):
    """Vertices and triangles are numbered at random: whoever follows the indices jumps about in the
    file."""

    def __init__(self, mesh: Giant, seed: int) -> None:
        super().__init__(mesh)
        self._vertices = Permutation(mesh.vertex_count, seed * 2)
        self._triangles = Permutation(mesh.triangle_count, seed * 2 + 1)

    def vertices_of(self, ids: Ids) -> Vertices:
        return self._mesh.vertices_of(self._vertices.inverse(ids))

    def triangles_of(self, ids: Ids) -> Ids:
        corners = self._mesh.triangles_of(self._triangles.forward(ids))
        return self._vertices.forward(corners.reshape(-1)).reshape(-1, 3)

    def materials_of(self, ids: Ids) -> NDArray[np.uint32] | None:
        return self._mesh.materials_of(self._triangles.forward(ids))


class Soup(_Variant):
    """Triangle k has the vertices 3 k, 3 k + 1 and 3 k + 2, as in an STL file."""

    def __init__(self, mesh: Giant) -> None:
        super().__init__(mesh)
        self.vertex_count = 3 * mesh.triangle_count

    def vertices_of(self, ids: Ids) -> Vertices:
        triangle, corner = np.divmod(ids, 3)
        return self._mesh.vertices_of(
            self._mesh.triangles_of(triangle)[np.arange(len(ids)), corner]
        )

    def vertices(self, begin: int, end: int) -> Vertices:
        first, last = begin // 3, -(-end // 3)
        if first == last:
            return self.vertices_of(np.zeros(0, np.int64))
        block = self._mesh.block(first, last)
        corners = Vertices(block.positions, block.uvs)[block.triangles.reshape(-1)]
        return corners[begin - 3 * first : end - 3 * first]

    def triangles_of(self, ids: Ids) -> Ids:
        return 3 * ids[:, None] + np.arange(3)

    def materials_of(self, ids: Ids) -> NDArray[np.uint32] | None:
        return self._mesh.materials_of(ids)


class Permutation:
    """A bijection of [0, count) that looks random, and its inverse: a Feistel network (Luby and
    Rackoff, "How to Construct Pseudorandom Permutations from Pseudorandom Functions", 1988) on the
    next even number of bits, followed until it is back in the range (Black and Rogaway, "Ciphers
    with Arbitrary Finite Domains", 2002)."""

    def __init__(self, count: int, seed: int) -> None:
        self._count = count
        self._bits = np.uint64(max(1, -(-(count - 1).bit_length() // 2)))
        self._mask = np.uint64((1 << int(self._bits)) - 1)
        self._seed = seed

    def forward(self, ids: Ids) -> Ids:
        return self._walk(ids, range(_ROUNDS), forwards=True)

    def inverse(self, ids: Ids) -> Ids:
        return self._walk(ids, range(_ROUNDS)[::-1], forwards=False)

    def _walk(self, ids: Ids, rounds: range, forwards: bool) -> Ids:
        out = self._mixed(ids.astype(np.uint64), rounds, forwards)
        while len(outside := np.flatnonzero(out >= np.uint64(self._count))):
            out[outside] = self._mixed(out[outside], rounds, forwards)
        return out.astype(np.int64)

    def _mixed(self, x: NDArray[np.uint64], rounds: range, forwards: bool) -> NDArray[np.uint64]:
        left, right = x >> self._bits, x & self._mask
        for k in rounds:
            if forwards:
                left, right = right, left ^ (hashed(right, self._seed * 8 + k) & self._mask)
            else:
                left, right = right ^ (hashed(left, self._seed * 8 + k) & self._mask), left
        out: NDArray[np.uint64] = (left << self._bits) | right
        return out
