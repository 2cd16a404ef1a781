"""Houses and towers: facades of windows that are set back, and flat roofs with boxes on them."""

from functools import cache

import numpy as np
import textures
from numpy.typing import NDArray
from pieces import Pieces

CELL = 3.0  # metres from window to window, and from floor to floor
_DEPTH = 0.3
_WALLS = (textures.BRICK, textures.PLASTER, textures.CONCRETE)
_BOX = np.array([[x, y, z] for y in (0, 1) for z in (0, 1) for x in (0, 1)], np.float64)
_BOX_SIDES = [[4, 6, 7, 5], [0, 1, 5, 4], [3, 2, 6, 7], [2, 0, 4, 6], [1, 3, 7, 5]]


def add_building(
    pieces: Pieces,
    corner: tuple[float, float, float],
    columns: tuple[int, int],
    floors: int,
    random: NDArray[np.float64],
) -> None:
    """A building with its lowest corner at `corner`, so many windows along x and z. `random` has
    eight numbers in [0, 1)."""
    wall = _WALLS[int(random[0] * len(_WALLS))]
    x, y, z = corner
    wide, deep, high = columns[0] * CELL, columns[1] * CELL, floors * CELL
    sides = [
        ((x, z + deep), (1, 0), columns[0]),
        ((x + wide, z + deep), (0, -1), columns[1]),
        ((x + wide, z), (-1, 0), columns[0]),
        ((x, z), (0, 1), columns[1]),
    ]
    for (at_x, at_z), (right_x, right_z), count in sides:
        places, uvs, triangles, is_glass = _facade(count, floors)
        along, up, inwards = places.T
        points = np.empty((len(places), 3))
        # Inwards is to the left of the way along the wall, seen from above.
        points[:, 0] = at_x + along * right_x + inwards * right_z
        points[:, 1] = y + up
        points[:, 2] = at_z + along * right_z - inwards * right_x
        pieces.add(points, uvs, triangles, np.where(is_glass, textures.GLASS, wall))
    _add_roof(pieces, (x, y + high, z), columns)
    for k in range(2):
        a, b, c = random[1 + 3 * k : 4 + 3 * k]
        size = np.array([2.0 + 3 * a, 1.5 + 2 * b, 2.0 + 3 * c])
        place = np.array([x + a * (wide - size[0]), y + high, z + c * (deep - size[2])])
        _add_box(pieces, place, size)


@cache
def _facade(columns: int, floors: int):
    """Points (along, up, inwards), texture coordinates, triangles and which of them are glass."""
    across, up = np.meshgrid(np.arange(columns + 1), np.arange(floors + 1))
    grid = np.stack([across.ravel(), up.ravel(), np.zeros(across.size)], axis=1)
    column, floor = (n.ravel() for n in np.meshgrid(np.arange(columns), np.arange(floors)))
    first = floor * (columns + 1) + column
    corners = np.stack([first, first + 1, first + columns + 2, first + columns + 1], axis=1)
    window = np.array([[0.2, 0.3], [0.8, 0.3], [0.8, 0.85], [0.2, 0.85]])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    at = np.stack([column, floor], axis=1)[:, None] + window[None]
    frame = np.concatenate([at, np.zeros((*at.shape[:2], 1))], axis=2).reshape(-1, 3)
    sunk = frame + np.array([0, 0, _DEPTH / CELL])
    count = len(column)
    outer = len(grid) + 4 * np.arange(count)[:, None] + np.arange(4)
    inner, pane = outer + 4 * count, outer + 8 * count
    after = [1, 2, 3, 0]
    quads = [np.stack([corners, corners[:, after], outer[:, after], outer], axis=2)]
    quads += [np.stack([outer, outer[:, after], inner[:, after], inner], axis=2)]
    walls, glass = _split(np.concatenate(quads).reshape(-1, 4)), _split(pane)
    places = np.concatenate([grid, frame, sunk, sunk]) * CELL
    on_wall = np.concatenate([grid, frame, sunk + np.array([0.02, 0.02, 0])])[:, :2]
    uvs = np.concatenate([on_wall, np.tile(square, (count, 1))])
    is_glass = np.repeat([False, True], [len(walls), len(glass)])
    return places, uvs, np.concatenate([walls, glass]), is_glass


def _split(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _add_roof(pieces: Pieces, at: tuple[float, float, float], columns: tuple[int, int]) -> None:
    i, j = (n.ravel() for n in np.meshgrid(np.arange(columns[0] + 1), np.arange(columns[1] + 1)))
    points = np.stack([at[0] + i * CELL, np.full(i.size, at[1]), at[2] + j * CELL], axis=1)
    a, b = (n.ravel() for n in np.meshgrid(np.arange(columns[0]), np.arange(columns[1])))
    first, width = b * (columns[0] + 1) + a, columns[0] + 1
    quads = np.stack([first + width, first + width + 1, first + 1, first], axis=1)
    pieces.add(points, np.stack([i, j], axis=1) / 2, _split(quads), textures.ROOF)


def _add_box(pieces: Pieces, place: NDArray[np.float64], size: NDArray[np.float64]) -> None:
    points = place + _BOX[np.array(_BOX_SIDES).ravel()] * size
    uvs = np.tile([[0, 0], [1, 0], [1, 1], [0, 1]], (5, 1))
    pieces.add(points, uvs, _split(np.arange(20).reshape(5, 4)), textures.CONCRETE)
