"""Polygons and strips as triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.geometry.mesh import UInt32Array, to_uint32


def fans(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Polygons of `counts[i]` corners, stored one after another, cut into fans around their first
    corner: (t, 3) positions of corners and (t,) the polygon each came from. Polygons of fewer
    than three corners give nothing."""
    starts = np.cumsum(counts) - counts
    pieces = np.maximum(counts - 2, 0)
    parents = np.repeat(np.arange(len(counts)), pieces)
    corner = np.arange(len(parents)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    first = starts[parents]
    return np.stack([first, first + corner + 1, first + corner + 2], axis=1), parents


def strips(counts: NDArray[np.int64], values: NDArray[Any], restart: int | None) -> UInt32Array:
    """Triangle strips of `counts[i]` indices, stored one after another, as (t, 3) triangles whose
    winding alternates. The value `restart` ends a strip within a strip."""
    ends = np.zeros(len(values) + 1, bool)
    ends[np.cumsum(counts)] = True
    ends = ends[1:]  # the last index of each strip
    restarts = np.zeros(len(values), bool) if restart is None else values == restart
    # The position of each index in its own strip, counted from the last break before it.
    breaks = np.zeros(len(values), bool)
    if len(values):
        breaks[0] = True
        breaks[1:] = ends[:-1] | restarts[:-1]
    last_break = np.maximum.accumulate(np.where(breaks, np.arange(len(values)), 0))
    position = np.arange(len(values)) - last_break
    last = np.flatnonzero((position >= 2) & ~restarts)
    odd = position[last] % 2 == 1
    a = np.where(odd, last - 1, last - 2)
    b = np.where(odd, last - 2, last - 1)
    out: UInt32Array = to_uint32(values)[np.stack([a, b, last], axis=1)]
    return out
