"""Rays to measure with: primary rays of three views, and what bounces from their hits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from umbel.geometry.mesh import Mesh

Rays = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Origins and directions, (n, 3) each."""

VIEWS = ((1.0, 0.6, 1.3), (-1.2, 0.4, 0.5), (0.3, -0.5, -1.4))
"""From where the three views look at the middle, in diagonals of the box."""

TILE = 4


def primary_rays(low: NDArray[np.float32], high: NDArray[np.float32], size: int) -> Rays:
    """The rays of three square pictures of size x size pixels, size a multiple of 4, in tiles of
    4 x 4, with a vertical field of view of 40 degrees."""
    low, high = low.astype(np.float64), high.astype(np.float64)
    middle = (low + high) / 2
    # Of a point, too, views are apart from the middle.
    least = max(1e-9 * float(np.abs(middle).max()), 1e-30)
    diagonal = max(float(np.linalg.norm(high - low)), least)
    tiles = size // TILE
    ty, tx, y, x = np.meshgrid(*(np.arange(n) for n in (tiles, tiles, TILE, TILE)), indexing="ij")
    across = ((tx * TILE + x).ravel() + 0.5) / size * 2 - 1
    down = ((ty * TILE + y).ravel() + 0.5) / size * 2 - 1
    spread = np.tan(np.radians(20.0))
    origins, directions = [], []
    for view in VIEWS:
        eye = middle + np.array(view) * diagonal / np.linalg.norm(view) * 0.9
        forward = (middle - eye) / np.linalg.norm(middle - eye)
        right = np.cross(forward, (0.0, 1.0, 0.0))
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        rays = forward + spread * (across[:, None] * right - down[:, None] * up)
        origins.append(np.broadcast_to(eye, rays.shape))
        directions.append(rays / np.linalg.norm(rays, axis=1, keepdims=True))
    return (
        np.ascontiguousarray(np.concatenate(origins), dtype=np.float32),
        np.ascontiguousarray(np.concatenate(directions), dtype=np.float32),
    )


def diffuse_rays(
    mesh: Mesh, rays: Rays, t: NDArray[np.float32], primitive: NDArray[np.int32], seed: int = 1
) -> Rays:
    """A ray from each hit, its direction distributed by the cosine to the surface's normal."""
    hit = primitive >= 0
    points, normals = surface(mesh, (rays[0][hit], rays[1][hit]), t[hit], primitive[hit])
    out = cosine_directions(normals, np.random.default_rng(seed))
    return points.astype(np.float32), out.astype(np.float32)


def surface(
    mesh: Mesh, rays: Rays, t: NDArray[np.float32], primitive: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points a little above where rays hit, and unit normals on the rays' side."""
    origins, directions = rays[0].astype(np.float64), rays[1].astype(np.float64)
    corners = mesh.positions[mesh.triangles[primitive]].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0, normals / np.maximum(lengths, 1e-300), -directions)
    normals *= -np.sign(np.einsum("ij,ij->i", normals, directions))[:, None]
    extent = float(np.abs(mesh.positions).max(initial=0.0))
    return origins + directions * t[:, None] + normals * max(extent, 1e-30) * 1e-6, normals


def cosine_directions(
    normals: NDArray[np.float64], dice: np.random.Generator
) -> NDArray[np.float64]:
    """A direction about each normal, distributed by the cosine to it."""
    # A point on the unit sphere around the normal's end lies in a direction of that distribution.
    ball = dice.normal(size=normals.shape)
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    out = normals + ball * 0.9999
    unit: NDArray[np.float64] = out / np.linalg.norm(out, axis=1, keepdims=True)
    return unit
