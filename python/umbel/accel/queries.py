"""The queries that every structure over triangles answers: rays, distances and overlaps."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.accel.inputs import point_of
from umbel.accel.rays import RayQueries
from umbel.errors import Error
from umbel.geometry.arrays import number, numbers, rows, thread_count
from umbel.geometry.camera import moved_planes


@dataclass(frozen=True)
class ClosestPoints:
    """The point of the surface that is nearest to each query point."""

    point: NDArray[Any]
    """(n, 3) float32, or float64 where the structure has an origin."""
    distance: NDArray[np.float32]
    """(n,) infinite where nothing lies within the distance asked for."""
    primitive: NDArray[np.int32]
    """(n,) triangle; -1 where there is none."""
    u: NDArray[np.float32]
    v: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.distance)


class TriangleQueries(RayQueries, ABC):
    """Rays, distances and overlaps. Results do not depend on the structure."""

    _native: _umbel.TriangleQueries

    @abstractmethod
    def statistics(self) -> dict[str, Any]:
        """What it holds and costs: among others `nodes leaves max_depth references sah_cost
        bytes`."""

    # Distances.

    def closest_point(
        self, points: ArrayLike, max_distance: float = math.inf, *, threads: int = 0
    ) -> ClosestPoints:
        """The nearest point of the surface to each of (n, 3) points, within `max_distance`."""
        limit = number("max_distance", max_distance)
        if not limit >= 0:
            raise Error(f"max_distance cannot be {max_distance}")
        local = rows("points", self._local("points", points), 3)
        found = ClosestPoints(*self._native.closest_point(local, limit, thread_count(threads)))
        if not self._origin.any():
            return found
        return replace(found, point=self._origin + found.point)

    def contains(self, points: ArrayLike, *, threads: int = 0) -> NDArray[np.bool_]:
        """(n,) whether each of (n, 3) points lies inside; the mesh must be closed."""
        local = rows("points", self._local("points", points), 3)
        return self._native.contains(local, thread_count(threads))

    def signed_distance(self, points: ArrayLike, *, threads: int = 0) -> NDArray[np.float32]:
        """(n,) distance of each of (n, 3) points to the surface, negative inside."""
        local = rows("points", self._local("points", points), 3)
        return self._native.signed_distance(local, thread_count(threads))

    # Overlaps: (k,) int32 indices of the triangles that touch a region, sorted.

    def overlaps_box(self, low: ArrayLike, high: ArrayLike) -> NDArray[np.int32]:
        """Triangles that touch the box from `low` to `high`, both (3,)."""
        return self._native.overlaps_box(self._point("low", low), self._point("high", high))

    def overlaps_sphere(self, center: ArrayLike, radius: float) -> NDArray[np.int32]:
        """Triangles that touch the ball around `center`, (3,)."""
        middle = self._point("center", center)
        return self._native.overlaps_sphere(middle, number("radius", radius))

    def overlaps_frustum(self, planes: ArrayLike) -> NDArray[np.int32]:
        """Triangles that touch the points with a x + b y + c z + d >= 0 for all planes, (6, 4)
        rows of a, b, c, d; near its edges a few more."""
        array = numbers("planes", planes)
        if self._origin.any() and array.shape == (6, 4):
            array = moved_planes(array, -self._origin)
        array = rows("planes", array, 4)
        if len(array) != 6:
            raise Error(f"planes must have shape (6, 4), not {array.shape}")
        return self._native.overlaps_frustum(array)

    @property
    def bounds(self) -> NDArray[Any] | None:
        """(2, 3) least and greatest corner, float64 where there is an origin; None without
        triangles."""
        box = np.array(self._native.bounds, np.float32)
        if (box[0] > box[1]).any():
            return None
        return self._origin + box if self._origin.any() else box

    def _point(self, name: str, value: ArrayLike) -> Sequence[float]:
        return tuple(np.asarray(self._local(name, point_of(name, value))).tolist())

    def __len__(self) -> int:
        return self._native.triangle_count


class SpatialPartition(TriangleQueries):
    """What kd-trees and uniform structures say of themselves besides."""

    _native: _umbel.KdTree | _umbel.TwoLevelGrid | _umbel.Octree | _umbel.IntervalHierarchy

    def statistics(self) -> dict[str, Any]:
        """`nodes leaves empty_leaves max_depth references sah_cost inner_visits leaf_visits tests
        bytes`; visits and tests are those that a random line is expected to make."""
        return self._native.statistics()

    @property
    def sah_cost(self) -> float:
        """Expected cost of a random line."""
        return float(self._native.statistics()["sah_cost"])
