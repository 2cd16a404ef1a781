"""Which tiles there are: an octree of cells over the finest level, split where a cell has more than
a tile's worth of the source's triangles, and the error of the tiles that are split on each depth.

The cells of one depth that are split show one cut of the whole asset, and those that are not show
the source. So an error is chosen for each depth, not for each tile: tiles of one error fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from umbel.export.piece import Doubles
from umbel.export.source import Source

MOST_DEPTH = 18
"""A cell that is this small is not split, whatever is in it."""

_MOST_WHOLE = 0.9
"""The extent of an instance that is not cut, of the cell's side."""

_MARGIN = 2.0**-10
"""How far within its cell an instance is that is no larger, of the cell's side."""

_FEW_CLUSTERS = 4
"""What a cell has at least if it is split: counts are of whole clusters."""


def _none() -> NDArray[np.intp]:
    return np.zeros(0, np.intp)


@dataclass
class Tile:
    """A cell, and what its content is."""

    depth: int
    place: tuple[int, int, int]  #: of the cells of its depth, along x, y and z
    error: float  #: of the content; 0: the source's triangles
    children: list[Tile] = field(default_factory=list)
    box: NDArray[np.float64] | None = None  #: of the content, once written; None: no content
    triangles: int = 0  #: of the content
    whole: NDArray[np.intp] = field(default_factory=_none)  #: instances that no plane cuts

    @property
    def name(self) -> str:
        x, y, z = self.place
        return f"{self.depth}/{x}_{y}_{z}"


@dataclass(frozen=True)
class Grid:
    """The cube that the cells divide. Its side is a power of two and its corner a multiple of a
    fraction of that, so that planes between cells are exact in floats, too."""

    corner: Doubles
    side: float

    @staticmethod
    def around(low: Doubles, high: Doubles) -> Grid:
        """The least such cube."""
        extent = float((high - low).max())
        size = max(extent, float(np.abs(np.concatenate([low, high])).max()) * 2.0**-20, 2.0**-100)
        side = 2.0 ** np.ceil(np.log2(size))
        while True:
            corner = np.floor(low / side * 2**6) * side / 2**6
            if (corner + side > high).all():
                return Grid(corner, float(side))
            side *= 2

    def cell(self, tile: Tile) -> tuple[Doubles, Doubles]:
        """The least and greatest corner of a tile's cell."""
        size = self.side / 2**tile.depth
        low = self.corner + np.array(tile.place) * size
        return low, low + size

    def cuts(self, tile: Tile) -> Iterator[tuple[int, float, bool]]:
        """The planes from the whole cube to a cell: (axis, value, whether the cell is above)."""
        low, side = self.corner.copy(), self.side
        for depth in range(1, tile.depth + 1):
            side /= 2
            for axis in range(3):
                above = bool(tile.place[axis] >> (tile.depth - depth) & 1)
                yield axis, float(low[axis] + side), above
                low[axis] += side if above else 0.0


@dataclass
class Plan:
    """The tree of tiles, and the error of each depth."""

    grid: Grid
    root: Tile
    errors: list[float]

    def tiles(self) -> Iterator[Tile]:
        """All tiles, parents first."""
        stack = [self.root]
        while stack:
            tile = stack.pop()
            yield tile
            stack.extend(reversed(tile.children))

    def keep_whole(self, boxes: Doubles) -> NDArray[np.bool_]:
        """Gives instances, with boxes (i, 6), to the tiles that have their centres, down to the
        finest, and returns which: those that stick out of none of these by more than half a cell.
        Each is then whole in one tile of any cut through the tree, where planes would cut many."""
        used = np.flatnonzero((boxes[:, :3] <= boxes[:, 3:]).all(axis=1))
        centers = np.zeros((len(boxes), 3))
        centers[used] = (boxes[used, :3] + boxes[used, 3:]) / 2
        depth = np.zeros(len(boxes), np.int64)
        for tile, inside in self._down(centers, used):
            depth[inside] = tile.depth
        extent = np.maximum(boxes[:, 3:] - boxes[:, :3], 0).max(axis=1, initial=0.0)
        is_whole = np.zeros(len(boxes), bool)
        is_whole[used] = extent[used] <= _MOST_WHOLE * self.grid.side / 2.0 ** depth[used]
        for tile, inside in self._down(centers, np.flatnonzero(is_whole)):
            tile.whole = inside
        return is_whole

    def _down(
        self, centers: Doubles, instances: NDArray[np.intp]
    ) -> Iterator[tuple[Tile, NDArray[np.intp]]]:
        """The tiles that have these instances' centres, parents first. Makes those of them that no
        cluster touches."""
        stack = [(self.root, instances)]
        while stack:
            tile, inside = stack.pop()
            yield tile, inside
            if not tile.children:
                continue
            low, high = self.grid.cell(tile)
            above = centers[inside] >= (low + high) / 2
            octants = above @ np.array([1, 2, 4])
            for octant in np.unique(octants).tolist():
                stack.append((_child(tile, octant), inside[octants == octant]))

    def keep_inside(self, boxes: Doubles) -> None:
        """Gives instances to the tiles whose cells have them whole."""
        stack = [(self.root, np.flatnonzero((boxes[:, :3] <= boxes[:, 3:]).all(axis=1)))]
        while stack:
            tile, inside = stack.pop()
            low, high = self.grid.cell(tile)
            inner = (high - low) * _MARGIN
            within = (boxes[inside, :3] >= low + inner) & (boxes[inside, 3:] <= high - inner)
            tile.whole = inside[within.all(axis=1)]
            stack += [(child, tile.whole) for child in tile.children]

    def prune(self) -> None:
        """Drops tiles that turned out to have nothing in them or below."""
        for tile in reversed(list(self.tiles())):
            tile.children = [c for c in tile.children if c.box is not None or c.children]


def make_plan(source: Source, tile_triangles: int) -> Plan:
    """Chooses tiles of about so many triangles."""
    grid = Grid.around(*source.bounds())
    found = list(source.cluster_boxes(0.0))
    boxes = np.concatenate([b for b, _ in found])
    centers = (boxes[:, :3] + boxes[:, 3:]) / 2
    counts = np.concatenate([c for _, c in found]).astype(np.int64)
    root = Tile(0, (0, 0, 0), 0.0)
    layer = [(root, np.arange(len(boxes)))]
    errors: list[float] = []
    finest = 0
    while layer:
        split = []
        for tile, inside in layer:
            count, clusters = _count(grid, tile, centers, counts, inside)
            splits = count > tile_triangles and clusters > _FEW_CLUSTERS
            if splits and tile.depth < MOST_DEPTH:
                split.append((tile, inside))
            else:
                finest += count
        if split:
            wanted = tile_triangles * len(split) + finest
            error = min(source.error_for(wanted), *errors[-1:], np.inf)
            if error <= 0:
                break  # there is nothing coarser to show
            errors.append(error)
        layer = []
        for tile, inside in split:
            tile.error = errors[-1]
            layer += _split(grid, tile, boxes, inside)
    return Plan(grid, root, errors)


def _count(
    grid: Grid, tile: Tile, centers: Doubles, counts: NDArray[np.int64], inside: NDArray[np.intp]
) -> tuple[int, int]:
    """The triangles of the clusters whose centres are in a cell, and how many these are."""
    low, high = grid.cell(tile)
    chosen = centers[inside]
    own = ((chosen >= low) & (chosen < high)).all(axis=1)
    return int(counts[inside[own]].sum()), int(own.sum())


def _split(
    grid: Grid, tile: Tile, boxes: Doubles, inside: NDArray[np.intp]
) -> list[tuple[Tile, NDArray[np.intp]]]:
    """The octants of a cell that clusters touch, with these. Its error's cut may be in others, too,
    but the source is not, so nothing is to be shown there."""
    made = []
    middle, _ = grid.cell(Tile(tile.depth + 1, _octant(tile, 7), 0.0))
    chosen = boxes[inside]
    below, above = (chosen[:, :3] <= middle).T, (chosen[:, 3:] >= middle).T
    for octant in range(8):
        x, y, z = ((above if octant >> k & 1 else below)[k] for k in range(3))
        touching = inside[x & y & z]
        if len(touching):
            made.append((_child(tile, octant), touching))
    return made


def _octant(tile: Tile, octant: int) -> tuple[int, int, int]:
    x, y, z = (2 * tile.place[k] + (octant >> k & 1) for k in range(3))
    return x, y, z


def _child(tile: Tile, octant: int) -> Tile:
    """The tile of an octant, which is made if there is none."""
    place = _octant(tile, octant)
    for child in tile.children:
        if child.place == place:
            return child
    child = Tile(tile.depth + 1, place, 0.0)
    tile.children.append(child)
    return child
