"""Where a mesh lies in the world: positions are float32, relative to an origin in float64."""

from __future__ import annotations

import math
import os
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error

_FAR = 16.0
"""Positions farther from zero than so many times half their extent lose bits that matter."""


@dataclass(frozen=True)
class Rounding:
    """What a mesh lost when its positions became float32."""

    largest_move: float = 0.0  #: of a vertex that triangles use
    degenerate: int = 0  #: triangles that had an area and have none any more

    def __add__(self, more: Rounding) -> Rounding:
        """One after the other."""
        return Rounding(self.largest_move + more.largest_move, self.degenerate + more.degenerate)


def rounding_loss(
    world: NDArray[Any],
    origin: NDArray[np.float64],
    positions: NDArray[np.float32],
    triangles: NDArray[np.uint32],
) -> Rounding:
    """What became of triangles whose corners were `world` and are origin + positions."""
    points = np.ascontiguousarray(world, np.float64)
    return Rounding(*_umbel.rounding_loss(points, origin.tolist(), positions, triangles))


def zero_origin() -> NDArray[np.float64]:
    """No origin: positions are the world's."""
    return np.zeros(3)


def origin_of(value: Any) -> NDArray[np.float64]:
    """Three finite numbers, as an array of its own."""
    try:
        origin = np.array(value, np.float64)
    except (TypeError, ValueError):
        raise Error(f"origin must be three numbers, not {value!r}") from None
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise Error(f"origin must be three finite numbers, not {value!r}")
    return origin + 0.0  # without the sign of zero


def warn_of_origin(path: str | os.PathLike[str], origin: NDArray[np.float64]) -> None:
    """Says that a file of this kind does not hold an origin that is not zero."""
    if origin.any():
        warnings.warn(
            f"{os.fspath(path)} does not hold the origin {tuple(origin.tolist())}: give it to load",
            UserWarning,
            stacklevel=3,
        )


def localize(
    points: ArrayLike, triangles: NDArray[np.uint32] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """An origin for (n, 3) points, and the points relative to it in float32.

    The origin is zero where float32 holds every coordinate exactly, or where the points lie so near
    to zero that they lose little: within 16 times half the extent of their box. Else it is the
    middle of that box, rounded to a multiple of a power of two of at most the box's longest side.
    Points that are not finite count for nothing, and so do those of none of the triangles, where
    there are any: files from maps often have a vertex at zero that nothing uses.
    """
    from umbel.geometry.arrays import numbers

    array = numbers("points", points)
    if array.size and (array.ndim != 2 or array.shape[1] != 3):
        raise Error(f"points must have shape (n, 3), not {array.shape}")
    with np.errstate(over="ignore", invalid="ignore"):
        rounded = np.ascontiguousarray(array, np.float32)
        if rounded.size == 0 or array.dtype == np.float32:
            return zero_origin(), rounded
        used = slice(None) if triangles is None else _used(len(array), triangles)
        origin = _origin(array[used], rounded[used])
        if origin.any():
            rounded = (array - origin).astype(np.float32)
        return origin, rounded


def relative_transform(
    matrix: NDArray[Any], mesh_origin: NDArray[np.float64], origin: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(3, 4): a matrix that takes a mesh to the world, as one that takes the mesh's positions to
    points relative to `origin`."""
    local = np.array(matrix[:3], np.float64)
    if mesh_origin.any() or origin.any():
        local[:, 3] += local[:, :3] @ mesh_origin - origin
    return local


def _used(count: int, triangles: NDArray[np.uint32]) -> NDArray[np.bool_] | slice:
    """Which of so many vertices triangles use; all of them where none is used."""
    used = np.zeros(count, bool)
    used[triangles[triangles < count]] = True
    return slice(None) if used.all() or not used.any() else used


def is_far(points: NDArray[Any]) -> bool:
    """Whether points lie so far from zero, for their extent, that `localize` may move them."""
    return len(points) > 0 and _is_far(*_box(points))


def _is_far(low: NDArray[np.float64], high: NDArray[np.float64]) -> bool:
    extent = float((high - low).max(initial=0.0))
    farthest = float(np.maximum(np.abs(low), np.abs(high)).max(initial=0.0))
    return math.isfinite(extent) and farthest > _FAR * (extent / 2)


def _origin(points: NDArray[Any], rounded: NDArray[np.float32]) -> NDArray[np.float64]:
    low, high = _box(points)
    if not _is_far(low, high):
        return zero_origin()
    if ((rounded == points) | ~np.isfinite(points)).all():
        return zero_origin()
    extent = float((high - low).max())
    if extent == 0.0:
        return low + 0.0
    step = 2.0 ** math.floor(math.log2(extent))
    origin: NDArray[np.float64] = np.round((low / 2 + high / 2) / step) * step
    return origin + 0.0


def _box(points: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The corners of the box of the finite points, in float64; NaN where there are none."""
    low, high = _extremes(points)
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        finite = points[np.isfinite(points).all(axis=1)]
        if not len(finite):
            return np.full(3, np.nan), np.full(3, np.nan)
        low, high = _extremes(finite)
    return low, high


def _extremes(points: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # Column by column, which NumPy does many times faster than all at once.
    columns = [points[:, k] for k in range(3)]
    low = np.array([column.min() for column in columns], np.float64)
    return low, np.array([column.max() for column in columns], np.float64)
