"""Height fields: one square of cells, or many tiles with vertices of their own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from umbel.testing.giant.mesh import Giant, Ids, Vertices, on_grid
from umbel.testing.giant.noise import Noise, hashed, pairs, unit

_CHART = 128


class Grid(Giant):
    """Tiles of the same size in rows, numbered row by row, as are a tile's vertices and cells. A
    cell is two triangles. The last ones may be missing."""

    def __init__(
        self,
        triangles: int,
        seed: int,
        tile: tuple[int, int],
        tiles_a_row: int,
        jitter: float,
        charts: bool,
    ) -> None:
        self.triangle_count = triangles
        self.rows, self.columns = tile
        self.tiles_a_row = tiles_a_row
        self.tile_triangles = 2 * self.rows * self.columns
        self._tile_vertices = (self.rows + 1) * (self.columns + 1)
        self.vertex_count = self._tile_vertices * math.ceil(triangles / self.tile_triangles)
        self.has_uvs = charts
        self._seed, self._jitter = seed, jitter
        self._noise = Noise(seed)

    def vertices_of(self, ids: Ids) -> Vertices:
        tile, local = np.divmod(ids, self._tile_vertices)
        row, column = np.divmod(local, self.columns + 1)
        down, right = np.divmod(tile, self.tiles_a_row)
        i, j = row + down * self.rows, column + right * self.columns
        return self._vertices(i, j, self._noise.at(i, j), row, column)

    def vertices(self, begin: int, end: int) -> Vertices:
        pieces = []
        while begin < end:
            tile, local = divmod(begin, self._tile_vertices)
            count = min(end - begin, self._tile_vertices - local)
            pieces.append(self._of_tile(tile, local, local + count))
            begin += count
        if len(pieces) == 1:
            return pieces[0]
        if not pieces:
            return self.vertices_of(np.zeros(0, np.int64))
        uvs = [piece.uvs for piece in pieces if piece.uvs is not None]
        positions = np.concatenate([piece.positions for piece in pieces])
        return Vertices(positions, np.concatenate(uvs) if uvs else None)

    def _of_tile(self, tile: int, begin: int, end: int) -> Vertices:
        """The vertices [begin, end) of a tile, by whole rows of heights."""
        width = self.columns + 1
        top, bottom = begin // width, -(-end // width)
        down, right = divmod(tile, self.tiles_a_row)
        first_row, first_column = down * self.rows, right * self.columns
        heights = self._noise.grid(
            (first_row + top, first_row + bottom), (first_column, first_column + width)
        )
        row = np.repeat(np.arange(top, bottom), width)
        column = np.tile(np.arange(width), bottom - top)
        which = slice(begin - top * width, end - top * width)
        row, column = row[which], column[which]
        z = heights.reshape(-1)[which]
        return self._vertices(row + first_row, column + first_column, z, row, column)

    def _vertices(self, i: Ids, j: Ids, z: NDArray[np.float64], row: Ids, column: Ids) -> Vertices:
        points = np.empty((len(i), 3))
        points[:, 0], points[:, 1], points[:, 2] = j, i, z
        if self._jitter:
            bits = hashed(pairs(i, j), self._seed * 64 + 63)
            points[:, 0] += (unit(bits, 0) - 0.5) * self._jitter
            points[:, 1] += (unit(bits, 1) - 0.5) * self._jitter
        points = on_grid(points)
        points += self.origin
        uvs = None
        if self.has_uvs:
            uvs = np.empty((len(i), 2), np.float32)
            uvs[:, 0], uvs[:, 1] = column / self.columns, row / self.rows
        return Vertices(points, uvs)

    def triangles_of(self, ids: Ids) -> Ids:
        tile, local = np.divmod(ids, self.tile_triangles)
        row, cell = np.divmod(local >> 1, self.columns)
        width = self.columns + 1
        corner = tile * self._tile_vertices + row * width + cell
        upper = (local & 1).astype(bool)
        out = np.empty((len(ids), 3), np.int64)
        out[:, 0] = corner
        out[:, 1] = corner + np.where(upper, width + 1, 1)
        out[:, 2] = corner + np.where(upper, width, width + 1)
        return out

    def triangles(self, begin: int, end: int) -> Ids:
        # Whole rows are one pattern, moved.
        a_row, width = 2 * self.columns, self.columns + 1
        first, last = begin // a_row, -(-end // a_row)
        pattern = self.triangles_of(np.arange(min(a_row, self.tile_triangles)))
        tile, row = np.divmod(np.arange(first, last), self.rows)
        at = tile * self._tile_vertices + row * width
        ids: Ids = (at[:, None, None] + pattern[None]).reshape(-1, 3)
        out: Ids = ids[begin - first * a_row : end - first * a_row]
        return out


def _sides(count: int) -> int:
    return math.isqrt(count - 1) + 1 if count > 0 else 1


def terrain_grid(triangles: int, seed: int, charts: bool) -> Grid:
    """One square, or charts of it."""
    cells = -(-triangles // 2)
    if charts:
        return Grid(triangles, seed, (_CHART, _CHART), _sides(-(-cells // _CHART**2)), 0.0, True)
    columns = _sides(cells)
    return Grid(triangles, seed, (-(-cells // columns), columns), 1, 0.0, False)


def scan_grid(
    triangles: int, seed: int, tile: int, origin: tuple[float, float, float], charts: bool
) -> Grid:
    """Tiles of a scan: vertices are off the grid's points by up to a fifth of a cell."""
    tiles = -(-triangles // (2 * tile * tile))
    grid = Grid(triangles, seed, (tile, tile), _sides(tiles), 0.4, charts)
    x, y, z = (float(math.floor(value)) for value in origin)
    grid.origin = (x, y, z)
    return grid
