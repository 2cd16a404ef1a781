"""Rays, triangles and brute force to compare hierarchies with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import umbel
from umbel import Mesh


def instructions() -> list[str]:
    """The values of `simd` that this machine has."""
    usable = []
    for simd in ("portable", "avx2", "avx512"):
        try:
            umbel.Bvh(umbel.shapes.sphere(0), simd=simd)
            usable.append(simd)
        except umbel.Error as error:
            assert error.code == "unsupported"
    return usable


def random_directions(count: int, seed: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).normal(size=(count, 3)).astype(np.float32)


def ball_rays(count: int, seed: int = 1) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rays through and beside the unit ball."""
    random = np.random.default_rng(seed)
    origins = random.uniform(-2, 2, (count, 3)).astype(np.float32)
    targets = random.uniform(-1, 1, (count, 3)).astype(np.float32)
    return origins, targets - origins


def random_soup(count: int, size: float) -> Mesh:
    """Random triangles of about that size in the unit box."""
    random = np.random.default_rng(20)
    middle = random.uniform(0, 1, (count, 1, 3))
    corners = middle + random.uniform(-size, size, (count, 3, 3))
    return Mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count).reshape(-1, 3))


def brute_force(
    mesh: Mesh, origins: NDArray[np.float32], directions: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For every ray and triangle (n, m), in double precision: t of the plane, and how far inside
    the triangle it is met (the least barycentric coordinate)."""
    a, b, c = mesh.positions[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    o, d = origins.astype(np.float64)[:, None], directions.astype(np.float64)[:, None]
    with np.errstate(all="ignore"):
        p = np.cross(d, (c - a)[None])
        det = np.einsum("nmk,mk->nm", p, b - a)
        s = o - a[None]
        u = np.einsum("nmk,nmk->nm", s, p) / det
        q = np.cross(s, (b - a)[None])
        v = np.einsum("nmk,nmk->nm", q, np.broadcast_to(d, q.shape)) / det
        t = np.einsum("nmk,mk->nm", q, c - a) / det
        inside = np.minimum(np.minimum(u, v), 1 - u - v)
    return np.where(np.isnan(t), np.inf, t), np.where(np.isnan(inside), -np.inf, inside)


def nearest(t: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where((inside >= 0) & (t >= 0), t, np.inf).min(axis=1)


def is_clear(t: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rays that pass no triangle's border so closely that single precision could not tell."""
    return ~((np.abs(inside) < 1e-5) & (t > -1e-3)).any(axis=1)
