"""Buildings: boxes of cells with windows set back, on a grid of streets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from umbel.testing.giant.mesh import Giant, Ids, Vertices, on_grid
from umbel.testing.giant.noise import hashed, unit

_CELLS = 8  # along each edge of a building
_SPACING = 32.0
_WALL, _ROOF = 0, 1


class City(Giant):
    """Each building is the same pattern of vertices and triangles, placed and stretched."""

    material_count = 2

    def __init__(self, triangles: int, seed: int, charts: bool) -> None:
        self._places, self._pattern, self._uvs = _box(charts)
        self._materials = np.repeat(
            np.array([_WALL, _WALL, _WALL, _WALL, _ROOF, _ROOF], np.uint32), 2 * _CELLS * _CELLS
        )
        self.triangle_count = triangles
        buildings = -(-triangles // len(self._pattern))
        self.vertex_count = buildings * len(self._places)
        self.has_uvs = charts
        self._seed = seed
        self._buildings_a_row = int(np.ceil(np.sqrt(buildings)))

    def vertices_of(self, ids: Ids) -> Vertices:
        building, which = np.divmod(ids, len(self._places))
        place = self._places[which]
        bits = hashed(building.astype(np.uint64), self._seed * 64)
        out = np.empty((len(ids), 3))
        out[:, 0] = (building % self._buildings_a_row) * _SPACING
        out[:, 1] = (building // self._buildings_a_row) * _SPACING
        out[:, 2] = 0.0
        size = 12.0 + np.rint(unit(bits, 0) * 8.0)
        height = 8.0 + np.rint(unit(bits, 1) * unit(bits, 1) * 90.0)
        out[:, 0] += place[:, 0] / _CELLS * size
        out[:, 1] += place[:, 1] / _CELLS * size
        out[:, 2] += place[:, 2] / _CELLS * height
        # Windows: points inside of a wall are set back, each by its own depth.
        inside = (place > 0) & (place < _CELLS)
        depth = 0.1 + 0.4 * unit(hashed(ids_of_places(building, place), self._seed * 64 + 1))
        for axis in range(3):
            others = inside[:, (axis + 1) % 3] & inside[:, (axis + 2) % 3]
            out[:, axis] += np.where(others & (place[:, axis] == 0), depth, 0.0)
            out[:, axis] -= np.where(others & (place[:, axis] == _CELLS), depth, 0.0)
        return Vertices(on_grid(out), None if self._uvs is None else self._uvs[which])

    def triangles_of(self, ids: Ids) -> Ids:
        building, which = np.divmod(ids, len(self._pattern))
        out: Ids = self._pattern[which] + (building * len(self._places))[:, None]
        return out

    def materials_of(self, ids: Ids) -> NDArray[np.uint32]:
        out: NDArray[np.uint32] = self._materials[ids % len(self._pattern)]
        return out


def ids_of_places(building: Ids, place: Ids) -> NDArray[np.uint64]:
    """One number for each point of each building, whatever vertices are there."""
    local = (place[:, 0] * 16 + place[:, 1]) * 16 + place[:, 2]
    return (building * 4096 + local).astype(np.uint64)


def _box(charts: bool) -> tuple[Ids, Ids, NDArray[np.float32] | None]:
    """A box's points in cells, its triangles, and texture coordinates if each side is a chart."""
    side = np.arange(_CELLS + 1)
    a, b = (grid.reshape(-1) for grid in np.meshgrid(side, side, indexing="ij"))
    i, j = (grid.reshape(-1) for grid in np.meshgrid(side[:-1], side[:-1], indexing="ij"))
    corner = i * (_CELLS + 1) + j
    low = np.stack([corner, corner + _CELLS + 1, corner + _CELLS + 2], axis=1)
    high = np.stack([corner, corner + _CELLS + 2, corner + 1], axis=1)
    square = np.stack([low, high], axis=1).reshape(-1, 3)
    places: list[Ids] = []
    triangles: list[Ids] = []
    for axis in range(3):  # the last two sides are the ground and the roof
        for end in (0, _CELLS):
            points = np.empty((len(a), 3), np.int64)
            points[:, axis] = end
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = a, b
            triangles.append((square if end else square[:, ::-1]) + len(a) * len(places))
            places.append(points)
    every, pattern = np.concatenate(places), np.concatenate(triangles)
    if charts:
        uvs = np.tile(np.stack([a, b], axis=1) / _CELLS, (6, 1)).astype(np.float32)
        return every, pattern, uvs
    unique, inverse = np.unique(every, axis=0, return_inverse=True)
    return unique, inverse.reshape(-1)[pattern], None
