"""Structures that divide space uniformly, without a cost model: they build about as fast as a sort,
for comparisons, and for meshes that few rays are traced through."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypedDict

from numpy.typing import ArrayLike

from umbel import _umbel
from umbel.accel.inputs import geometry_of, mesh_from
from umbel.accel.queries import SpatialPartition
from umbel.accel.rays import mask_array
from umbel.errors import Error
from umbel.geometry.arrays import about, thread_count
from umbel.geometry.origin import origin_of
from umbel.geometry.repair import Progress

if TYPE_CHECKING:
    from typing_extensions import Unpack


class CommonOptions(TypedDict, total=False):
    """The options of all structures; `compact`, `masks` and `invalid` are those of `umbel.Bvh`."""

    compact: bool
    masks: ArrayLike | None
    cost: tuple[float, float]
    """(traversal, intersection), for statistics; 3 and 2 where not given."""
    invalid: Literal["refuse", "drop"]
    progress: Progress | None


class _Uniform(SpatialPartition):
    _native: _umbel.TwoLevelGrid | _umbel.Octree | _umbel.IntervalHierarchy
    _counted = ("nodes", "nodes")
    """One of the statistics, and what it counts."""

    def __repr__(self) -> str:
        field, parts = self._counted
        count = self.statistics()[field]
        return f"<{type(self).__name__}: {len(self)} triangles, {count} {parts}>"

    def _build(
        self,
        structure: type[_umbel.TwoLevelGrid | _umbel.Octree | _umbel.IntervalHierarchy],
        source: tuple[Any, ArrayLike | None],
        threads: int,
        settings: dict[str, Any],
        *,
        compact: bool = False,
        masks: ArrayLike | None = None,
        cost: tuple[float, float] = (3, 2),
        invalid: Literal["refuse", "drop"] = "refuse",
        progress: Progress | None = None,
    ) -> None:
        if invalid not in ("refuse", "drop"):
            raise Error(f"invalid must be 'refuse' or 'drop', not {invalid!r}")
        mesh = mesh_from(*source)
        self._origin = origin_of(mesh.origin)
        given = {**settings, "compact": bool(compact), "cost": cost}
        geometry, bits = geometry_of(mesh), mask_array(masks, len(mesh.triangles))
        count = thread_count(threads)
        try:
            with about(mesh):
                self._native = structure.build(
                    geometry,
                    masks=bits,
                    progress=progress,
                    threads=count,
                    drop_invalid=invalid == "drop",
                    **given,
                )
        except TypeError:
            raise Error(f"one of these settings is of the wrong type: {given!r}") from None


class TwoLevelGrid(_Uniform):
    """A grid whose cells hold grids (Kalojanov, Billeter & Slusallek 2011), with the queries of
    `umbel.Bvh`."""

    _counted = ("leaves", "cells")

    def __init__(
        self,
        positions: Any,
        triangles: ArrayLike | None = None,
        threads: int = 0,
        *,
        density: float = 0.12,
        leaf_density: float = 2.4,
        max_references: float = 16,
        **options: Unpack[CommonOptions],
    ) -> None:
        """
        positions, triangles: as of `umbel.Bvh`.
        density, leaf_density: 0.001..16, cells a triangle of the whole grid, and of a cell's own.
        max_references: 1..64, most references a triangle; grids are made coarser to keep to it.
        """
        settings = {
            "density": density,
            "leaf_density": leaf_density,
            "max_references": max_references,
        }
        self._build(_umbel.TwoLevelGrid, (positions, triangles), threads, settings, **options)


class Octree(_Uniform):
    """An octree (Glassner 1984), with the queries of `umbel.Bvh`: a cube is cut into eight, again
    and again, and each leaf lists the triangles that touch its cell."""

    def __init__(
        self,
        positions: Any,
        triangles: ArrayLike | None = None,
        threads: int = 0,
        *,
        max_leaf_size: int = 8,
        max_depth: int | None = None,
        max_references: float = 16,
        **options: Unpack[CommonOptions],
    ) -> None:
        """
        positions, triangles: as of `umbel.Bvh`.
        max_leaf_size: 1..64; cells of so few triangles are not cut any more.
        max_depth: 1..20; 6 + log4(m) where None.
        max_references: 1..64, most references a triangle, which bounds memory.
        """
        settings = {
            "max_leaf_size": max_leaf_size,
            "max_depth": 0 if max_depth is None else max_depth,
            "max_references": max_references,
        }
        self._build(_umbel.Octree, (positions, triangles), threads, settings, **options)


class IntervalHierarchy(_Uniform):
    """The bounding interval hierarchy (Waechter & Keller 2006), with the queries of `umbel.Bvh`."""

    def __init__(
        self,
        positions: Any,
        triangles: ArrayLike | None = None,
        threads: int = 0,
        *,
        max_leaf_size: int = 4,
        **options: Unpack[CommonOptions],
    ) -> None:
        """
        positions, triangles: as of `umbel.Bvh`.
        max_leaf_size: 1..64, most triangles a leaf.
        """
        settings = {"max_leaf_size": max_leaf_size}
        self._build(_umbel.IntervalHierarchy, (positions, triangles), threads, settings, **options)
