"""The tables of a LOD DAG as NumPy structured arrays, and the cuts that they give."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _umbel
from .arrays import indices
from .camera import Camera
from .errors import Error

LEVEL = np.dtype([("offset", "<u4"), ("count", "<u4")])
GROUP = np.dtype(
    [
        ("cluster_offset", "<u4"),
        ("cluster_count", "<u4"),
        ("level", "<u4"),
        ("rung", "<u4"),
        ("center", "<f4", 3),
        ("radius", "<f4"),
        ("error", "<f4"),
    ]
)
CLUSTER = np.dtype(
    [
        ("group", "<u4"),
        ("generating_group", "<u4"),
        ("material", "<u4"),
        ("vertex_count", "<u4"),
        ("triangle_count", "<u4"),
        ("box_min", "<f4", 3),
        ("box_max", "<f4", 3),
    ]
)
NODE = np.dtype(
    [
        ("center", "<f4", 3),
        ("radius", "<f4"),
        ("error", "<f4"),
        ("group", "<u4"),
        ("child_offset", "<u4"),
        ("child_count", "<u4"),
    ]
)
NONE = 0xFFFFFFFF
"""Stands where there is no such group."""


class Tables:
    """Levels, groups, clusters and hierarchy nodes; read-only views of the library's memory."""

    def __init__(self, native: _umbel.Tables) -> None:
        self._native = native

    @staticmethod
    def _named(words: NDArray[np.uint32], dtype: np.dtype[Any]) -> NDArray[Any]:
        return words.view(dtype).reshape(len(words))

    @property
    def levels(self) -> NDArray[Any]:
        """(l,) `offset count` of `groups`, finest level first."""
        return self._named(self._native.levels, LEVEL)

    @property
    def groups(self) -> NDArray[Any]:
        """(g,) `cluster_offset cluster_count level rung center radius error`; the error is that
        of the group once simplified, infinite where nothing coarser exists."""
        return self._named(self._native.groups, GROUP)

    @property
    def clusters(self) -> NDArray[Any]:
        """(c,) `group generating_group material vertex_count triangle_count box_min box_max`."""
        return self._named(self._native.clusters, CLUSTER)

    @property
    def nodes(self) -> NDArray[Any]:
        """(n,) `center radius error group child_offset child_count`; node 0 is the root."""
        return self._named(self._native.nodes, NODE)

    def cut(
        self,
        *,
        error: float | None = None,
        camera: Camera | None = None,
        level: int | None = None,
        triangles: int | None = None,
        hierarchy: bool = True,
    ) -> NDArray[np.uint32]:
        """The clusters, ascending, that show the mesh with at most this `error` (in its unit),
        as this `camera` needs it, as it is on this `level` (0: the mesh itself), or with at most
        this many `triangles` where such a cut exists. `hierarchy` finds them through the nodes,
        without looking at all groups; the answer is the same."""
        given = {"error": error, "camera": camera, "level": level, "triangles": triangles}
        chosen = [name for name, value in given.items() if value is not None]
        if len(chosen) != 1:
            raise Error(
                "a cut needs exactly one of error, camera, level and triangles, "
                f"not {' and '.join(chosen) or 'none'}"
            )
        return self._native.select(self._view(chosen[0], given[chosen[0]]), hierarchy)

    def _view(self, kind: str, value: Any) -> _umbel.View:
        if isinstance(value, Camera):
            return value.view()
        if kind == "camera":
            raise Error(f"camera must be an umbel.Camera, not a {type(value).__name__}")
        if not value >= 0:
            raise Error(f"{kind} must not be negative, and is {value}")
        if kind == "error":
            return _umbel.view_error(value)
        if kind == "level":
            return _umbel.view_level(min(int(value), NONE))
        return _umbel.view_error(self._native.error_for_triangles(min(int(value), 2**63)))

    def cut_error(self, cut: ArrayLike) -> float:
        """The largest error of what a cut shows, in the mesh's unit; 0 for level 0."""
        return self._native.cut_error(indices("cut", cut))

    def cut_triangles(self, cut: ArrayLike) -> int:
        """How many triangles a cut has."""
        return int(self.clusters["triangle_count"][indices("cut", cut)].sum(dtype=np.int64))
