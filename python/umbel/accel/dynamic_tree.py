"""Trees over boxes that come and go: online insertion and removal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.accel.bvh import Refit
from umbel.accel.inputs import box_of
from umbel.accel.tree_options import TreeOptions, tree_config
from umbel.accel.trees import Bvh2
from umbel.errors import Error
from umbel.geometry.arrays import array_of, rows, thread_count, whole

if TYPE_CHECKING:
    from typing_extensions import Unpack


class DynamicTree:
    """A binary tree over boxes that are put in, moved and taken out one at a time, for scenes in
    which objects move, appear and vanish. Boxes have numbers, which are given again once free. No
    other thread may use the tree while it changes.

        tree = umbel.bvh.DynamicTree(boxes)     # numbers 0, 1, ...
        new = tree.insert(more_boxes)
        tree.remove(new[:3])
        tree.overlaps_box(low, high)
    """

    def __init__(
        self,
        boxes: ArrayLike | None = None,
        builder: str = "quality",
        threads: int = 0,
        **options: Unpack[TreeOptions],
    ) -> None:
        """
        boxes: (n, 6), min x, y, z, max x, y, z of each; none where None.
        The other arguments are those of `umbel.Bvh`.
        """
        self._config = tree_config(builder, options)
        given = np.zeros((0, 6), np.float32) if boxes is None else _boxes(boxes)
        self._native = _umbel.DynamicTree.build(given, self._config, thread_count(threads))

    def insert(self, boxes: ArrayLike) -> NDArray[np.uint32]:
        """Puts (k, 6) boxes, or (6,) one, where they add least to the area of the tree (Bittner et
        al. 2015), one after the other; their (k,) numbers. All are checked first."""
        given = _boxes(boxes)
        _check(given)
        return self._native.insert(given)

    def remove(self, numbers: ArrayLike) -> None:
        """Takes boxes out by their numbers, (k,) or one. All are checked first."""
        self._native.remove(self._in_use(numbers))

    def move(self, numbers: ArrayLike, boxes: ArrayLike) -> None:
        """Takes boxes out and puts them where the new ones, (k, 6), belong."""
        self._native.move(*self._pairs(numbers, boxes))

    def refit(self, numbers: ArrayLike, boxes: ArrayLike) -> None:
        """Gives boxes new ones, (k, 6), where they are, and brings all above them up to date: for
        many small steps. The tree keeps its shape."""
        self._native.refit(*self._pairs(numbers, boxes))

    def rebuild(self, *, threads: int = 0) -> None:
        """Builds the tree again over what there is, as at first; numbers stay."""
        self._native.rebuild(self._config, thread_count(threads))

    def quality(self) -> Refit:
        """The cost of the tree now, with one box a leaf, and when it was built, and whether a new
        build would pay: from 1.5 times that on. A tree that began empty was not built, and is not
        advised, before its first `rebuild`."""
        return Refit(*self._native.quality())

    def overlaps_box(self, low: ArrayLike, high: ArrayLike) -> NDArray[np.uint32]:
        """(k,) numbers of the boxes that touch the box from `low` to `high`, both (3,), sorted."""
        return self._native.overlaps_box(box_of(low, high))

    def box(self, number: int) -> NDArray[np.float32]:
        """(6,) the box with that number."""
        return np.array(self._native.box(whole("number", number)), np.float32)

    def snapshot(self, max_leaf_size: int = 8) -> Bvh2:
        """The tree as it is now, with leaves of up to that many boxes by cost. Over the boxes of
        triangles, `umbel.Bvh.from_tree` traces it."""
        most = whole("max_leaf_size", max_leaf_size)
        return Bvh2(self._native.snapshot(most), self._config, None)

    def __contains__(self, number: Any) -> bool:
        return isinstance(number, (int, np.integer)) and self._has(int(number))

    def __len__(self) -> int:
        return self._native.size

    def __repr__(self) -> str:
        return f"<DynamicTree: {len(self)} boxes>"

    def _has(self, number: int) -> bool:
        return 0 <= number < 2**32 and self._native.contains(number)

    def _in_use(self, given: ArrayLike) -> NDArray[np.uint32]:
        array = np.atleast_1d(array_of("numbers", given))
        if array.ndim != 1 or (array.size > 0 and array.dtype.kind not in "iu"):
            raise Error("numbers must be whole numbers, of shape (k,)")
        values = array.tolist()
        wrong = next((n for n in values if not self._has(n)), None)
        if wrong is not None:
            raise Error(f"there is no box {wrong} in the tree")
        if len(set(values)) != len(values):
            raise Error("numbers must differ from each other")
        return array.astype(np.uint32)

    def _pairs(
        self, given: ArrayLike, boxes: ArrayLike
    ) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        which, there = self._in_use(given), _boxes(boxes)
        if len(which) != len(there):
            raise Error(f"there are {len(which)} numbers and {len(there)} boxes")
        _check(there)
        return which, there


def _boxes(given: ArrayLike) -> NDArray[np.float32]:
    return rows("boxes", np.atleast_2d(array_of("boxes", given)), 6)


def _check(boxes: NDArray[np.float32]) -> None:
    good = np.isfinite(boxes).all(axis=1) & (boxes[:, :3] <= boxes[:, 3:]).all(axis=1)
    if not good.all():
        raise Error(f"box {int(np.argmin(good))} is empty, or has a NaN or infinite corner")
