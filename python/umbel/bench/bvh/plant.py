"""A large scene to measure with: a power station on hilly ground.

Few shapes, each baked into many positions, as exporters of CAD scenes write them: beams of
twelve long triangles beside pipes and tanks of thousands of small ones. Long triangles at odd
angles, and sizes that differ by four orders of magnitude, are what tells hierarchies apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error

if TYPE_CHECKING:
    from umbel.geometry.mesh import Mesh

Floats = NDArray[np.float64]

GROUND = 600.0
"""Length of a side of the ground; heights are along y."""
BUILT = 360.0
"""Length of a side of the middle of it, where the plant is."""
_STREETS = 40.0
_HILLS = 0.1  # times the heights of shapes.terrain

_SMALLEST, _LARGEST = 20_000, 50_000_000


class Arrays(NamedTuple):
    """A mesh where the compiled part of the package may be missing."""

    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]


class Shapes(NamedTuple):
    """What the compiled part makes; the rest needs NumPy alone."""

    terrain: Arrays
    blob: Arrays
    torus: Arrays


@dataclass(frozen=True)
class _Kind:
    """A shape and the share of all triangles that its copies are."""

    shape: Arrays
    share: float
    low: Sequence[float]
    """Least and greatest scale along the shape's axes."""
    high: Sequence[float]
    tilted: float
    """Share of the copies that lie along x or z, or at an odd angle, instead of upright."""
    up_to: float
    """Greatest height above the ground."""


def plant(triangles: int, seed: int = 1) -> Mesh:
    """The scene with this many triangles, give or take some per cent; y is up."""
    from umbel.geometry.mesh import Mesh

    return Mesh(*plant_arrays(triangles, plant_shapes(triangles), seed))


def check_triangles(triangles: int) -> None:
    """Refuses a number of triangles that no scene can have."""
    if not _SMALLEST <= triangles <= _LARGEST:
        raise Error(f"triangles must be from {_SMALLEST:,} to {_LARGEST:,}, not {triangles:,}")


def plant_shapes(triangles: int) -> Shapes:
    """What a scene of this many triangles is made of."""
    from umbel import shapes

    check_triangles(triangles)
    side = max(round((round(triangles * 0.15) / 2) ** 0.5), 4)
    made = (shapes.terrain(side, side), shapes.blob(4), shapes.torus(48, 16))
    return Shapes(*(Arrays(mesh.positions, mesh.triangles) for mesh in made))


def plant_arrays(triangles: int, shapes: Shapes, seed: int = 1) -> Arrays:
    """The scene, of the shapes for so many triangles."""
    dice = np.random.default_rng(seed)
    ground = _ground(shapes.terrain)
    parts = [ground]
    for kind in _kinds(shapes):
        copies = max(round(triangles * kind.share / len(kind.shape.triangles)), 1)
        parts.append(_copies(kind, copies, ground, dice))
    firsts = np.cumsum([0] + [len(part.positions) for part in parts[:-1]])
    return Arrays(
        np.concatenate([part.positions for part in parts]),
        np.concatenate(
            [part.triangles + np.uint32(first) for part, first in zip(parts, firsts, strict=True)]
        ),
    )


def _kinds(shapes: Shapes) -> list[_Kind]:
    return [
        _Kind(_tube(32, 24), 0.40, (0.2, 5, 0.2), (1.5, 60, 1.5), 0.8, 40),  # pipes
        _Kind(_tube(8, 1), 0.05, (0.02, 5, 0.02), (0.1, 60, 0.1), 0.9, 50),  # cables and rails
        _Kind(_box(), 0.03, (0.1, 2, 0.1), (0.5, 40, 0.5), 0.6, 60),  # beams
        _Kind(_box(), 0.0001, (4, 4, 4), (20, 30, 16), 0.0, 0),  # buildings
        _Kind(shapes.blob, 0.185, (1, 1, 1), (8, 8, 8), 0.0, 5),  # tanks
        _Kind(shapes.torus, 0.185, (0.3, 0.3, 0.3), (2, 2, 2), 0.5, 50),  # valves, wheels
    ]


def _ground(unit: Arrays) -> Arrays:
    low, high = unit.positions.min(axis=0), unit.positions.max(axis=0)
    flat = np.argsort(high - low)  # the heights are along the shortest side
    x, z, y = flat[2], flat[1], flat[0]
    span = (high - low).max()
    corners = (unit.positions - (low + high) / 2) / span * GROUND
    turned = np.stack([corners[:, x], corners[:, y] * _HILLS, corners[:, z]], axis=1)
    return Arrays(turned.astype(np.float32), unit.triangles)


def _copies(kind: _Kind, count: int, ground: Arrays, dice: np.random.Generator) -> Arrays:
    """The shape so many times, in blocks of streets as plants are built in."""
    low, high = np.array(kind.low, np.float64), np.array(kind.high, np.float64)
    scale = low * (high / low) ** dice.random((count, 3))
    at = (dice.random((count, 2)) - 0.5) * BUILT
    block = np.round(at / _STREETS) * _STREETS
    at = block + (dice.random((count, 2)) - 0.5) * _STREETS * 0.7
    above = dice.random(count) ** 2 * kind.up_to + scale[:, 1] / 2
    position = np.stack([at[:, 0], _heights(ground, at) + above, at[:, 1]], axis=1)
    axes = _orientations(count, kind.tilted, dice)
    points = kind.shape.positions.astype(np.float64)
    baked = np.einsum("pj,nj,nij->npi", points, scale, axes) + position[:, None, :]
    first = (np.arange(count) * len(points))[:, None, None]
    return Arrays(
        baked.reshape(-1, 3).astype(np.float32),
        (kind.shape.triangles[None].astype(np.int64) + first).reshape(-1, 3).astype(np.uint32),
    )


def _orientations(count: int, tilted: float, dice: np.random.Generator) -> Floats:
    """Rotations: upright, and of the tilted ones three quarters along x or z, the others odd."""
    quarter = {
        "x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    }
    axes = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    way = dice.random(count) / max(tilted, 1e-9)
    axes[way < 0.375] = quarter["x"]
    axes[(way >= 0.375) & (way < 0.75)] = quarter["z"]
    odd = (way >= 0.75) & (way < 1.0)
    axes[odd] = np.linalg.qr(dice.normal(size=(int(odd.sum()), 3, 3)))[0]
    return axes


def _heights(ground: Arrays, at: Floats) -> Floats:
    """The ground's height near points (x, z)."""
    side = round(len(ground.positions) ** 0.5)
    steps = np.clip((at / GROUND + 0.5) * (side - 1), 0, side - 1).round().astype(np.int64)
    ordered = ground.positions[np.lexsort((ground.positions[:, 2], ground.positions[:, 0]))]
    heights: Floats = ordered[steps[:, 0] * side + steps[:, 1], 1].astype(np.float64)
    return heights


def _tube(sides: int, rings: int) -> Arrays:
    """An open cylinder around y, of radius and height 1."""
    angle = np.arange(sides) / sides * 2 * np.pi
    ring = np.stack([np.cos(angle), np.zeros(sides), np.sin(angle)], axis=1)
    height = np.linspace(-0.5, 0.5, rings + 1)
    positions = ring[None] + height[:, None, None] * np.array([0.0, 1.0, 0.0])
    j, i = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    a, b = j * sides + i, j * sides + (i + 1) % sides
    lower = np.stack([a, a + sides, b], axis=-1)
    upper = np.stack([b, a + sides, b + sides], axis=-1)
    return Arrays(
        positions.reshape(-1, 3).astype(np.float32),
        np.concatenate([lower, upper]).reshape(-1, 3).astype(np.uint32),
    )


def _box() -> Arrays:
    """The unit cube around the origin, twelve triangles."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)]
    return Arrays(corners.astype(np.float32), np.array(faces, np.uint32))
