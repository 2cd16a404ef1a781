"""SAH kd-trees over boxes, for primitives that the caller tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.accel.inputs import box_of
from umbel.errors import Error
from umbel.geometry.arrays import configure, numbers, rows, thread_count
from umbel.geometry.repair import Progress

KD_NODE = np.dtype([("value", "<u4"), ("link", "<u4")])
"""A node of a `BoxKdTree`."""

Test = Callable[[NDArray[np.int64], NDArray[np.int32]], ArrayLike]
"""Called with (k,) numbers of rays and (k,) numbers of primitives: (k,) distances along the rays,
infinity where a ray misses."""


class BoxKdTree:
    """A kd-tree over the boxes of the caller's own primitives: spheres, curves, bricks of a volume.

    tree = umbel.BoxKdTree(np.hstack([centers - radius, centers + radius]))
    t, sphere = tree.intersect(origins, directions, distance_to_spheres)
    """

    def __init__(
        self,
        boxes: ArrayLike,
        builder: str = "exact",
        threads: int = 0,
        *,
        cost: tuple[float, float] | None = None,
        empty_bonus: float | None = None,
        max_depth: int | None = None,
        bad_refines: int | None = None,
        max_references: float | None = None,
        bins: int | None = None,
        target_leaf_size: int | None = None,
        progress: Progress | None = None,
    ) -> None:
        """
        boxes: (n, 6), min x, y, z, max x, y, z of each.
        The other arguments are those of `umbel.KdTree`.
        """
        config = _umbel.KdTreeConfig()
        options = {
            "builder": builder,
            "cost": cost,
            "empty_bonus": empty_bonus,
            "max_depth": max_depth,
            "bad_refines": bad_refines,
            "max_references": max_references,
            "bins": bins,
            "target_leaf_size": target_leaf_size,
        }
        configure(config, options)
        given = rows("boxes", boxes, 6)
        self._count = len(given)
        self._native = _umbel.BoxKdTree.build(given, config, progress, thread_count(threads))

    @property
    def nodes(self) -> NDArray[Any]:
        """(n,) `value link`, depth-first, a read-only view. The lowest two bits of `link` are the
        axis of an inner node, or 3 for a leaf. Inner: `value` is the plane as a float's bits, and
        the other 30 bits of `link` the child above it; the one below follows the node. Leaf:
        `value` is the first of its references, the other bits are how many."""
        words = self._native.nodes
        return words.view(KD_NODE).reshape(len(words))

    @property
    def references(self) -> NDArray[np.uint32]:
        """(r,) numbers of boxes, ascending in each leaf. A read-only view."""
        return self._native.references

    @property
    def bounds(self) -> NDArray[np.float32] | None:
        """(2, 3) least and greatest corner; None without boxes."""
        return np.array(self._native.bounds, np.float32).reshape(2, 3) if self._count else None

    def candidates(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = np.inf,
    ) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """The boxes in the leaves that rays pass through, from near to far: offsets (n + 1,) and
        numbers of boxes. A box that lies in several leaves may be there more than once."""
        starts, ways = rows("origins", origins, 3), rows("directions", directions, 3)
        if len(starts) != len(ways):
            raise Error(f"there are {len(starts)} origins and {len(ways)} directions")
        bounds = (_each(name, t, len(starts)) for name, t in (("t_min", t_min), ("t_max", t_max)))
        return self._native.candidates(starts, ways, *bounds)

    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        test: Test,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = np.inf,
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """The nearest hit of each ray by the caller's `test`: t (n,), infinity where there is none,
        and primitive (n,), -1 there; of hits at the same t the lowest primitive. The test is called
        once, with all pairs of rays and candidates; hits before t_min or behind t_max are left
        out."""
        offsets, primitives = self.candidates(origins, directions, t_min, t_max)
        count = len(offsets) - 1
        rays = np.repeat(np.arange(count, dtype=np.int64), np.diff(offsets))
        t = np.full(count, np.inf, np.float32)
        primitive = np.full(count, -1, np.int32)
        if len(rays) == 0:
            return t, primitive
        with np.errstate(over="ignore"):  # too far for float32 is a miss
            found = numbers("what test gives", test(rays, primitives)).astype(np.float32)
        if found.shape != rays.shape:
            raise Error(f"test must give {rays.shape} distances, not {found.shape}")
        low, high = _each("t_min", t_min, count), _each("t_max", t_max, count)
        with np.errstate(invalid="ignore"):
            hit = np.isfinite(found) & (found >= low[rays]) & (found <= high[rays])
        rays, primitives, found = rays[hit], primitives[hit], found[hit]
        order = np.lexsort((primitives, found, rays))
        first = order[np.unique(rays[order], return_index=True)[1]]
        t[rays[first]], primitive[rays[first]] = found[first], primitives[first]
        return t, primitive

    def overlaps_box(self, low: ArrayLike, high: ArrayLike) -> NDArray[np.int32]:
        """(k,) the boxes that touch the box from `low` to `high`, both (3,), sorted."""
        return self._native.overlaps_box(box_of(low, high))

    def statistics(self) -> dict[str, Any]:
        """`nodes leaves empty_leaves max_depth references sah_cost inner_visits leaf_visits tests
        bytes`; visits and tests are those that a random line is expected to make."""
        return self._native.statistics()

    @property
    def sah_cost(self) -> float:
        """Expected cost of a random line."""
        return float(self.statistics()["sah_cost"])

    def __len__(self) -> int:
        return self._count

    def __repr__(self) -> str:
        return f"<BoxKdTree: {len(self)} boxes, {len(self.nodes)} nodes>"


def _each(name: str, value: ArrayLike, count: int) -> NDArray[np.float32]:
    """One value, or one a ray, for each ray."""
    array = numbers(name, value)
    if array.shape not in ((), (count,)):
        raise Error(f"{name} must be a number or have shape ({count},), not {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, (count,)), np.float32)
