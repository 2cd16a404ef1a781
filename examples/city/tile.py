"""One square tile of the city: ground, streets, buildings and trees, in metres, y up. A tile is the
same whatever tiles are beside it; on their borders its vertices are equal to theirs."""

from pathlib import Path

import numpy as np
import textures
from buildings import CELL, add_building
from numpy.typing import NDArray
from pieces import Pieces
from trees import add_trees

import umbel
from umbel.testing.giant.noise import Noise

LOT = 32  # metres from the middle of a street to the next
_STREET = 4  # half its width
_NOISE = Noise(7, octaves=10)


def write_tile(path: Path, row: int, column: int, lots: int, middle: float) -> int:
    """Writes the tile of `lots` x `lots` as .glb; gives its triangles. `middle` is the x and z of
    the city's middle, where the towers are."""
    pieces = Pieces()
    _add_ground(pieces, row * lots * LOT, column * lots * LOT, lots * LOT)
    for k in range(lots * lots):
        _add_lot(pieces, row * lots + k // lots, column * lots + k % lots, middle)
    _add_street_trees(pieces, row, column, lots)
    mesh = umbel.Mesh(
        np.concatenate(pieces.positions),
        np.concatenate(pieces.triangles),
        uvs=np.concatenate(pieces.uvs),
        material_ids=np.concatenate(pieces.materials),
        materials=textures.materials(),
        name=path.stem,
    )
    umbel.save(path, mesh)
    return len(mesh.triangles)


def _heights(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
    # Places are moved so that none is negative.
    return 0.1 * _NOISE.at(rows + 4096, columns + 4096)


def _add_ground(pieces: Pieces, z: int, x: int, side: int) -> None:
    heights = 0.1 * _NOISE.grid((z + 4096, z + 4097 + side), (x + 4096, x + 4097 + side))
    j, i = (n.ravel() for n in np.mgrid[z : z + side + 1, x : x + side + 1])
    points = np.stack([i, heights.ravel(), j], axis=1)
    b, a = (n.ravel() for n in np.mgrid[0:side, 0:side])
    first, width = b * (side + 1) + a, side + 1
    triangles = [first + width, first + width + 1, first + 1, first + width, first + 1, first]
    from_street = [np.minimum(n % LOT, LOT - 1 - n % LOT) for n in (a, b)]
    is_street = np.minimum(*from_street) < _STREET
    material = np.where(is_street, textures.ASPHALT, textures.GRASS)
    # Coordinates of the whole city, so that there are no seams between tiles.
    uvs = np.stack([i, j], axis=1) / 8
    pieces.add(points, uvs, np.stack(triangles, axis=1).reshape(-1, 3), np.repeat(material, 2))


def _add_lot(pieces: Pieces, row: int, column: int, middle: float) -> None:
    generator = np.random.default_rng((row, column, 1))
    random = generator.random(8)
    x, z = column * LOT, row * LOT
    if random[7] < 0.12:  # a park
        feet = generator.uniform(6, LOT - 6, (14, 2)) + np.array([x, z])
        add_trees(pieces, _on_ground(feet), generator)
        return
    columns = tuple(int(n) for n in 4 + generator.integers(0, 4, 2))
    from_middle = np.hypot(x + LOT / 2 - middle, z + LOT / 2 - middle)
    towers = 34 * np.exp(-((from_middle / 450) ** 2))
    floors = int(2 + 7 * random[5] ** 2 + towers * random[6] ** 1.5)
    at_x, at_z = (n + (LOT - c * CELL) / 2 for n, c in zip((x, z), columns, strict=True))
    edges = np.array([[a, b] for a in (0, 0.5, 1) for b in (0, 0.5, 1)])
    ground = _on_ground(np.array([at_x, at_z]) + edges * np.array(columns) * CELL)[:, 1]
    add_building(pieces, (at_x, float(ground.min()) - 1, at_z), columns, floors, random)


def _add_street_trees(pieces: Pieces, row: int, column: int, lots: int) -> None:
    generator = np.random.default_rng((row, column, 2))
    along, street = np.meshgrid(np.arange(0.5, 4 * lots), np.arange(lots))
    across = street * LOT + _STREET + 1.2
    feet = np.stack([along.ravel() * LOT / 4, across.ravel()], axis=1)
    feet = feet[np.minimum(feet[:, 0] % LOT, LOT - feet[:, 0] % LOT) > _STREET + 1]
    corner = np.array([column, row]) * lots * LOT
    add_trees(pieces, _on_ground(feet + corner), generator)


def _on_ground(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) points on the ground at x and z, as the nearest of its vertices has it."""
    near = np.rint(places).astype(np.int64)
    return np.stack([places[:, 0], _heights(near[:, 1], near[:, 0]), places[:, 1]], axis=1)
