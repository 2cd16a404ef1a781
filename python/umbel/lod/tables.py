"""The tables of a LOD DAG as NumPy structured arrays, and the cuts that they give."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.cluster.clusters import ClusterBounds
from umbel.errors import Error
from umbel.geometry.arrays import (
    array_of,
    check_affine,
    indices,
    numbers,
    rows,
    thread_count,
    whole,
)
from umbel.geometry.camera import Camera, moved_planes
from umbel.geometry.origin import origin_of
from umbel.geometry.repair import Progress
from umbel.lod.verify import VerifyReport

LEVEL = np.dtype([("offset", "<u4"), ("count", "<u4")])
GROUP = np.dtype(
    [
        ("cluster_offset", "<u4"),
        ("cluster_count", "<u4"),
        ("level", "<u4"),
        ("method", "<u4"),
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

    def __init__(self, native: _umbel.Tables, origin: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self._native = native
        self.origin = origin_of(origin)
        """Where the tables' centres and boxes lie in the world; cameras and planes are in it."""

    @staticmethod
    def of_arrays(
        levels: NDArray[Any],
        groups: NDArray[Any],
        clusters: NDArray[Any],
        nodes: NDArray[Any] | None = None,
        origin: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Tables:
        """From structured arrays (LEVEL, GROUP, CLUSTER, NODE), as other programs may have stored
        them, relative to `origin`. Without nodes the hierarchy is built; empty levels are made from
        those of the groups, which then must not fall. Raises where an index leads nowhere."""
        return Tables(
            _umbel.Tables(
                _words("levels", levels, LEVEL),
                _words("groups", groups, GROUP),
                _words("clusters", clusters, CLUSTER),
                _words("nodes", np.empty(0, NODE) if nodes is None else nodes, NODE),
            ),
            origin,
        )

    @staticmethod
    def _named(words: NDArray[np.uint32], dtype: np.dtype[Any]) -> NDArray[Any]:
        return words.view(dtype).reshape(len(words))

    @property
    def levels(self) -> NDArray[Any]:
        """(l,) `offset count` of `groups`, finest level first."""
        return self._named(self._native.levels, LEVEL)

    @property
    def groups(self) -> NDArray[Any]:
        """(g,) `cluster_offset cluster_count level method center radius error`; the error is that
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
        bytes: int | None = None,
        clusters: int | None = None,
        groups: int | None = None,
        vertex_bytes: int = 32,
        planes: ArrayLike | None = None,
        normal_cones: ClusterBounds | None = None,
        method: str = "hierarchy",
        or_coarsest: bool = False,
    ) -> NDArray[np.uint32]:
        """The clusters, ascending, that show the mesh as asked.

        error, camera, level: with at most this error (in the mesh's unit; `math.inf` gives the
            coarsest cut), as this camera needs it, or as it is on this level (0: the mesh itself;
            one that is not there raises). At most one of them.
        triangles, bytes, clusters, groups: at most so much in all. The error or the camera's
            pixels become larger as far as that takes, and no further; what that leaves unused
            refines groups that still fit, those with the worst error first. Bytes are
            `vertex_bytes` a vertex and 3 a triangle; a group counts where any of its clusters is
            shown. At most one of them, not with `level`; alone they find the smallest error.
        or_coarsest: where no cut is as small as the budget says, give the coarsest; else that
            raises, and names the least that is possible.
        planes: (p, 4) inward unit normals and offsets as `Camera.planes` gives them; what is
            wholly outside one of them is left out, and costs nothing.
        normal_cones: what `normal_cones` of a Lod or an Asset gives; clusters that turn their back
            on the camera are left out.
        method: "hierarchy" goes down the nodes, "breadth_first" does so layer by layer, "flat"
            tests every cluster. The answer is the same.
        """
        view = self._wanted(error, camera, level)
        budget = self._budget(triangles, bytes, clusters, groups, vertex_bytes)
        culled = self._planes(planes), _normal_cones(normal_cones)
        if budget is None:
            return _umbel.select(self._native, _given(view), method, *culled)
        view = _umbel.view_error(0) if view is None else view
        _, cut = budget.select(self._native, view, culled, None)
        if not or_coarsest:
            budget.check(self, cut)
        return cut

    def view(
        self,
        *,
        error: float | None = None,
        camera: Camera | None = None,
        level: int | None = None,
        triangles: int | None = None,
        bytes: int | None = None,
        clusters: int | None = None,
        groups: int | None = None,
        vertex_bytes: int = 32,
        planes: ArrayLike | None = None,
        normal_cones: ClusterBounds | None = None,
        transforms: ArrayLike | None = None,
        or_coarsest: bool = False,
    ) -> _umbel.View:
        """What decides a cut, with the `error` or `threshold` that a budget leads to. Arguments
        as for `cut`, which goes on to fill the budget; with `transforms` the budget is for all
        instances together."""
        view = self._wanted(error, camera, level)
        budget = self._budget(triangles, bytes, clusters, groups, vertex_bytes)
        if budget is None:
            return _given(view)
        view = _umbel.view_error(0) if view is None else view
        culled = self._planes(planes), _normal_cones(normal_cones)
        rows = None if transforms is None else self._transforms(transforms)
        fitting = budget.view(self._native, view, culled, rows)
        if not or_coarsest:
            budget.check(self, *budget.cut(self._native, fitting, culled, rows))
        return fitting

    def _wanted(
        self, error: float | None, camera: Camera | None, level: int | None
    ) -> _umbel.View | None:
        """The view that was asked for, if any."""
        given = {"error": error, "camera": camera, "level": level}
        chosen = [name for name, value in given.items() if value is not None]
        if len(chosen) > 1:
            raise Error(f"a cut needs one of error, camera and level, not {' and '.join(chosen)}")
        if level is not None:
            check_level(level, len(self.levels))
        return self._view(chosen[0], given[chosen[0]]) if chosen else None

    def _budget(
        self,
        triangles: int | None,
        bytes: int | None,
        clusters: int | None,
        groups: int | None,
        vertex_bytes: int,
    ) -> _Budget | None:
        given = {"triangles": triangles, "bytes": bytes, "clusters": clusters, "groups": groups}
        chosen = [(name, value) for name, value in given.items() if value is not None]
        if not chosen:
            return None
        if len(chosen) > 1:
            raise Error(f"a cut needs at most one of {', '.join(given)}, not both")
        name, value = chosen[0]
        most = check_budget(name, value)
        if name == "groups":
            return _Budget(name, most, None, np.ones(len(self.groups), np.uint32))
        if name == "clusters":
            costs = np.ones(len(self.clusters), np.uint32)
        elif name == "bytes":
            costs = _umbel.byte_costs(self._native, whole("vertex_bytes", vertex_bytes))
        else:
            costs = np.ascontiguousarray(self.clusters["triangle_count"])
        return _Budget(name, most, costs, None)

    def instance_cuts(
        self,
        transforms: ArrayLike,
        view: _umbel.View,
        *,
        planes: ArrayLike | None = None,
        normal_cones: ClusterBounds | None = None,
    ) -> list[NDArray[np.uint32]]:
        """A cut for each instance. `transforms` are (i, 3, 4) or (i, 4, 4), from the mesh's space
        to the scene's, both in the world; `view` (see `Tables.view`) and `planes` are of the
        scene."""
        offsets, clusters = _umbel.select_instances(
            self._native,
            view,
            self._transforms(transforms),
            self._planes(planes),
            _normal_cones(normal_cones),
        )
        return np.split(clusters, offsets[1:-1]) if len(offsets) > 1 else []

    def _view(self, kind: str, value: Any) -> _umbel.View:
        if isinstance(value, Camera):
            return value.relative_to(self.origin).view()
        if kind == "camera":
            raise Error(f"camera must be an umbel.Camera, not a {type(value).__name__}")
        if kind == "level":
            return _umbel.view_level(value)
        check_error(value)
        return _umbel.view_error(value)

    def _planes(self, planes: ArrayLike | None) -> NDArray[np.float32] | None:
        if planes is None:
            return None
        if self.origin.any() and np.ndim(planes) == 2 and np.shape(planes)[1] == 4:
            planes = moved_planes(planes, -self.origin)
        return rows("planes", planes, 4)

    def _transforms(self, transforms: ArrayLike) -> NDArray[np.float32]:
        array = numbers("transforms", transforms)
        if array.ndim != 3 or array.shape[1:] not in ((3, 4), (4, 4)):
            raise Error(f"transforms must have shape (i, 3, 4) or (i, 4, 4), not {array.shape}")
        check_affine("transforms", array)
        local = array[:, :3]
        if self.origin.any():
            local = local.astype(np.float64)
            local[:, :, 3] += local[:, :, :3] @ self.origin - self.origin
        return np.ascontiguousarray(local, dtype=np.float32).reshape(-1, 12)

    def cut_error(self, cut: ArrayLike) -> float:
        """The largest error of what a cut shows, in the mesh's unit; 0 for level 0."""
        return self._native.cut_error(indices("cut", cut))

    def cut_triangles(self, cut: ArrayLike) -> int:
        """How many triangles a cut has."""
        chosen = indices("cut", cut)
        if len(chosen) and int(chosen.max()) >= len(self.clusters):
            raise Error(f"cut has the cluster {chosen.max()}, but there are {len(self.clusters)}")
        return int(self.clusters["triangle_count"][chosen].sum(dtype=np.int64))


def _words(name: str, table: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[np.uint32]:
    array = array_of(name, table)
    if array.size == 0:
        return np.empty((0, dtype.itemsize // 4), np.uint32)
    if array.ndim != 1 or array.dtype.names != dtype.names:
        raise Error(f"{name} must be (n,) of {dtype}, not {array.shape} of {array.dtype}")
    return np.ascontiguousarray(array, dtype).view(np.uint32).reshape(len(array), -1)


def check_error(error: float) -> None:
    """Raises where a cut cannot have at most this error."""
    if not error >= 0:
        raise Error(f"error must be 0 or more, not {error}")


def check_level(level: int, count: int) -> None:
    """Raises where there is no such level."""
    if whole("level", level) >= max(count, 1):
        raise Error(f"level is {level}, but the levels are 0 to {max(count - 1, 0)}")


def check_budget(name: str, budget: int) -> int:
    """The budget as a plain number; raises where it is none, or nothing fits it."""
    try:
        number = operator.index(budget)
    except TypeError:
        raise Error(f"{name} must be a whole number, not {budget!r}") from None
    if number < 1:
        raise Error(f"{name} must be at least 1, not {number}")
    return min(number, 2**63 - 1)


def _normal_cones(normal_cones: ClusterBounds | None) -> NDArray[np.float32] | None:
    return None if normal_cones is None else normal_cones.rows()


@dataclass(frozen=True)
class _Budget:
    """How much of something a cut may have."""

    name: str
    most: int
    cluster_costs: NDArray[np.uint32] | None
    group_costs: NDArray[np.uint32] | None

    def view(
        self, tables: _umbel.Tables, view: _umbel.View, culled: tuple[Any, Any], rows: Any
    ) -> _umbel.View:
        costs = np.empty(0, np.uint32) if self.cluster_costs is None else self.cluster_costs
        return _umbel.view_for_budget(
            tables, view, costs, self.most, *culled, rows, self.group_costs
        )

    def select(
        self, tables: _umbel.Tables, view: _umbel.View, culled: tuple[Any, Any], rows: Any
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Offsets and clusters of the cuts that fill the budget."""
        costs = np.empty(0, np.uint32) if self.cluster_costs is None else self.cluster_costs
        return _umbel.select_for_budget(
            tables, view, costs, self.most, *culled, rows, self.group_costs
        )

    def cut(
        self, tables: _umbel.Tables, view: _umbel.View, culled: tuple[Any, Any], rows: Any
    ) -> list[Any]:
        """The cuts of a view, one an instance."""
        if rows is None:
            return [_umbel.select(tables, view, "hierarchy", *culled)]
        offsets, clusters = _umbel.select_instances(tables, view, rows, *culled)
        return np.split(clusters, offsets[1:-1]) if len(offsets) > 1 else []

    def check(self, tables: Tables, *cuts: NDArray[np.uint32]) -> None:
        """Raises where the cuts have more, and so would the roots. (A view of a camera within the
        spheres of groups has those refined whatever it allows.)"""
        roots = np.flatnonzero(np.isinf(tables.groups["error"])[tables.clusters["group"]])
        if len(cuts) * self._cost(tables, roots) <= self.most:
            return
        least = sum(self._cost(tables, cut) for cut in cuts)
        if least > self.most:
            raise Error(f"{self.name} is {self.most}, but the coarsest cut has {least}")

    def _cost(self, tables: Tables, cut: NDArray[Any]) -> int:
        cost = 0
        if self.cluster_costs is not None:
            cost += int(self.cluster_costs[cut].sum(dtype=np.int64))
        if self.group_costs is not None:
            shown = np.unique(tables.clusters["group"][cut])
            cost += int(self.group_costs[shown].sum(dtype=np.int64))
        return cost


def _given(view: _umbel.View | None) -> _umbel.View:
    if view is None:
        raise Error(
            "a cut needs one of error, camera, level, triangles, bytes, clusters and groups"
        )
    return view


class HasTables(ABC):
    """What everything with tables and geometry can be asked: a Lod, an Asset."""

    _native: _umbel.Dag | _umbel.Asset

    @property
    def tables(self) -> Tables:
        """Levels, groups, clusters and nodes as NumPy views."""
        return Tables(self._native.tables, self._mesh_origin)

    @property
    @abstractmethod
    def _mesh_origin(self) -> NDArray[np.float64]:
        """Where the tables and meshes lie."""

    def cut(
        self,
        *,
        error: float | None = None,
        camera: Camera | None = None,
        level: int | None = None,
        triangles: int | None = None,
        bytes: int | None = None,
        **more: Any,
    ) -> NDArray[np.uint32]:
        """The clusters of a cut; all arguments as `Tables.cut` has them."""
        return self.tables.cut(
            error=error, camera=camera, level=level, triangles=triangles, bytes=bytes, **more
        )

    def normal_cones(
        self, *, progress: Callable[[float, str], Any] | None = None, threads: int = 0
    ) -> ClusterBounds:
        """Spheres and cones of normals of all clusters, for `Tables.cut`. Reads all geometry."""
        return ClusterBounds.of_rows(self._native.normal_cones(progress, thread_count(threads)))

    def verify(
        self,
        cuts: int = 64,
        *,
        seed: int = 1,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> VerifyReport:
        """The checks of `umbel.verify`; of what is in memory, those that need no file."""
        arguments = whole("cuts", cuts), whole("seed", seed), progress, thread_count(threads)
        return VerifyReport(**self._native.verify(*arguments))
