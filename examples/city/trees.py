"""Trees: a trunk, and leaves of two triangles each."""

import numpy as np
import textures
from numpy.typing import NDArray
from pieces import Pieces

LEAVES = 700
_SIDES, _RINGS = 8, 4
_LEAF = 0.22


def add_trees(pieces: Pieces, feet: NDArray[np.float64], random: np.random.Generator) -> None:
    """A tree at each of the points."""
    size = random.uniform(0.75, 1.3, len(feet))
    _add_trunks(pieces, feet, size)
    _add_crowns(pieces, feet, size, random)


def _add_trunks(pieces: Pieces, feet: NDArray[np.float64], size: NDArray[np.float64]) -> None:
    ring, side = (n.ravel() for n in np.mgrid[0:_RINGS, 0 : _SIDES + 1])
    angle = side * (2 * np.pi / _SIDES)
    radius = 0.22 - 0.04 * ring
    unit = np.stack([radius * np.cos(angle), 1.2 * ring - 0.3, -radius * np.sin(angle)], axis=1)
    first = (np.arange(_RINGS - 1)[:, None] * (_SIDES + 1) + np.arange(_SIDES)).ravel()
    quads = np.stack([first, first + 1, first + _SIDES + 2, first + _SIDES + 1], axis=1)
    pattern = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    points = feet[:, None] + unit[None] * size[:, None, None]
    triangles = (np.arange(len(feet)) * len(unit))[:, None, None] + pattern
    uvs = np.tile(np.stack([side / _SIDES, ring], axis=1), (len(feet), 1))
    pieces.add(points.reshape(-1, 3), uvs, triangles.reshape(-1, 3), textures.BARK)


def _add_crowns(
    pieces: Pieces,
    feet: NDArray[np.float64],
    size: NDArray[np.float64],
    random: np.random.Generator,
) -> None:
    count = len(feet) * LEAVES
    which = np.repeat(np.arange(len(feet)), LEAVES)
    # Leaves are outside more than inside.
    place = _directions(random, count) * random.random((count, 1)) ** 0.2
    place *= np.array([2.4, 2.0, 2.4]) * size[which, None]
    centre = feet[which] + place
    centre[:, 1] += 5.0 * size[which]
    along = _directions(random, count)
    across = np.cross(along, _directions(random, count))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-6)
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    points = np.stack([centre + _LEAF * (1.6 * u * along + v * across) for u, v in corners], axis=1)
    first = 4 * np.arange(count)
    triangles = np.stack([first, first + 1, first + 2, first, first + 2, first + 3], axis=1)
    uvs = np.tile((np.array(corners) + 1) / 2, (count, 1))
    pieces.add(points.reshape(-1, 3), uvs, triangles.reshape(-1, 3), textures.LEAVES)


def _directions(random: np.random.Generator, count: int) -> NDArray[np.float64]:
    vectors = random.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
