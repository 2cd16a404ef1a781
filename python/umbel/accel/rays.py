"""Rays as the library reads them, what they hit, and the queries that every structure answers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import array_of, numbers, rows, thread_count, whole
from umbel.geometry.origin import zero_origin


@dataclass(frozen=True)
class Hits:
    """The nearest hit of each ray, at (1 - u - v) p0 + u p1 + v p2 of its triangle."""

    t: NDArray[np.float32]
    """(n,) in lengths of the ray's direction; infinite where missed."""
    primitive: NDArray[np.int32]
    """(n,) triangle; -1 where missed."""
    u: NDArray[np.float32]
    v: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.t)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """(n,) whether each ray hit anything."""
        return self.primitive >= 0


@dataclass(frozen=True)
class AllHits:
    """Several hits a ray: those of ray i are at [offsets[i], offsets[i + 1]) of the other arrays,
    nearest first."""

    offsets: NDArray[np.int64]
    """(n + 1,)"""
    t: NDArray[np.float32]
    primitive: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def counts(self) -> NDArray[np.int64]:
        """(n,) hits of each ray."""
        return np.diff(self.offsets)

    @property
    def ray(self) -> NDArray[np.int64]:
        """(h,) the ray of each hit."""
        return np.repeat(np.arange(len(self)), self.counts)


class RayQueries:
    """Rays through a structure over triangles."""

    _native: _umbel.TriangleQueries
    _origin: NDArray[np.float64] = zero_origin()

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,): what the structure is relative to. Rays, points and answers are in the world."""
        return self._origin

    def _local(self, name: str, points: ArrayLike) -> ArrayLike:
        """Points of the world, relative to the structure."""
        if not self._origin.any():
            return points
        array = numbers(name, points)
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            return points  # refused where they are read
        return array.astype(np.float64) - self._origin

    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = math.inf,
        *,
        mask: int = 0xFFFFFFFF,
        cull_back_faces: bool = False,
        threads: int = 0,
    ) -> Hits:
        """The nearest hit of each ray: the points origin + t direction, t_min <= t <= t_max.

        A ray with a NaN, a zero direction or an empty interval hits nothing. `cull_back_faces`
        passes through triangles that are seen from behind."""
        rays = ray_arrays(self._local("origins", origins), directions, t_min, t_max)
        bits = whole("mask", mask)
        return Hits(
            *self._native.intersect(*rays, bits, bool(cull_back_faces), thread_count(threads))
        )

    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = math.inf,
        *,
        mask: int = 0xFFFFFFFF,
        cull_back_faces: bool = False,
        threads: int = 0,
    ) -> NDArray[np.bool_]:
        """(n,) whether each ray hits anything; faster than asking for the nearest."""
        rays = ray_arrays(self._local("origins", origins), directions, t_min, t_max)
        bits = whole("mask", mask)
        return self._native.occluded(*rays, bits, bool(cull_back_faces), thread_count(threads))

    def all_hits(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = math.inf,
        *,
        max_hits: int = 0,
        mask: int = 0xFFFFFFFF,
        cull_back_faces: bool = False,
        threads: int = 0,
    ) -> AllHits:
        """The nearest `max_hits` hits of each ray (0: all), each triangle at most once."""
        most = whole("max_hits", max_hits)
        rays = ray_arrays(self._local("origins", origins), directions, t_min, t_max)
        bits = whole("mask", mask)
        return AllHits(
            *self._native.all_hits(*rays, most, bits, bool(cull_back_faces), thread_count(threads))
        )


def mask_array(masks: ArrayLike | None, triangles: int) -> NDArray[np.uint32] | None:
    if masks is None:
        return None
    array = array_of("masks", masks)
    if array.shape != (triangles,) or (triangles > 0 and array.dtype.kind not in "iub"):
        raise Error(
            f"masks must be integers of shape ({triangles},), not {array.dtype} {array.shape}"
        )
    if array.size and (int(array.min()) < 0 or int(array.max()) > 0xFFFFFFFF):
        raise Error("masks must be from 0 to 0xffffffff")
    return np.ascontiguousarray(array, dtype=np.uint32)


def ray_arrays(
    origins: ArrayLike, directions: ArrayLike, t_min: ArrayLike, t_max: ArrayLike
) -> tuple[
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32] | None,
    NDArray[np.float32] | None,
]:
    """The arrays of rays as the library reads them, and checked."""
    starts, ways = vectors("origins", origins), vectors("directions", directions)
    count = max(len(starts), len(ways)) if len(starts) and len(ways) else 0
    return (
        starts,
        ways,
        _interval("t_min", t_min, 0.0, count),
        _interval("t_max", t_max, math.inf, count),
    )


def vectors(name: str, values: ArrayLike) -> NDArray[np.float32]:
    array = numbers(name, values)
    return rows(name, array[None] if array.shape == (3,) else array, 3)


def _interval(
    name: str, values: ArrayLike, default: float, count: int
) -> NDArray[np.float32] | None:
    array = numbers(name, values)
    if array.ndim > 1:
        raise Error(f"{name} must be a number or of shape (n,), not {array.shape}")
    if array.ndim == 0:
        if float(array) == default:
            return None
        array = array[None]
    elif array.size == 0 and count > 0:
        raise Error(f"{name} is empty, but there are {count} rays")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, dtype=np.float32)
