"""SAH kd-trees: rays over triangles, in cells that do not overlap."""

from __future__ import annotations

import os
from typing import Any

from numpy.typing import ArrayLike

from umbel import _umbel
from umbel.accel.inputs import geometry_of, mesh_from
from umbel.accel.queries import SpatialPartition
from umbel.accel.rays import mask_array
from umbel.errors import Error
from umbel.geometry.arrays import about, configure, thread_count
from umbel.geometry.origin import origin_of, warn_of_origin
from umbel.geometry.repair import Progress

BUILDERS = ("exact", "binned")
TRAVERSALS = ("stack", "ropes", "short-stack")


def _traversal(ropes: bool, name: str | None) -> str:
    if name is None:
        return "ropes" if ropes else "stack"
    if name not in TRAVERSALS:
        raise Error(f"traversal must be {' or '.join(map(repr, TRAVERSALS))}, not {name!r}")
    return name


class KdTree(SpatialPartition):
    """A kd-tree over triangles that answers what `umbel.Bvh` does, with the same results. It holds
    all that it needs: the mesh need not be kept."""

    _native: _umbel.KdTree

    def __init__(
        # Long: every setting is named and described here.
        self,
        positions: Any,
        triangles: ArrayLike | None = None,
        builder: str = "exact",
        ropes: bool = False,
        threads: int = 0,
        *,
        traversal: str | None = None,
        compact: bool = False,
        masks: ArrayLike | None = None,
        cost: tuple[float, float] | None = None,
        empty_bonus: float | None = None,
        max_depth: int | None = None,
        bad_refines: int | None = None,
        max_references: float | None = None,
        bins: int | None = None,
        target_leaf_size: int | None = None,
        invalid: str = "refuse",
        progress: Progress | None = None,
    ) -> None:
        """
        positions: (n, 3), with triangles (m, 3); or, alone, a mesh: an `umbel.Mesh`, the path of a
            file, anything with .vertices and .faces, a pair (positions, triangles).
        builder: "exact" (every plane that could be best) or "binned".
        ropes: go from leaf to leaf by links between neighbours instead of with a stack.
        traversal: "stack", "ropes" or "short-stack", in place of `ropes`; hits are the same.
        compact: share vertices between triangles: less memory, slower rays.
        masks: (m,) bits of each triangle; a query sees those that share a bit with its mask.
        cost: (traversal, intersection) of the surface-area heuristic.
        empty_bonus: 0..0.9, the bonus of splits that separate empty space.
        max_depth: 1..64; 8 + 1.3 log2(m) where None.
        bad_refines: 0..64 splits on one path that may cost more than a leaf.
        max_references: 1..64, most references a triangle, which bounds memory.
        bins: 4..256, of binned.
        target_leaf_size: 0..255; cells of so few triangles become leaves, whatever a split would
            save. By cost alone where None or 0.
        invalid: "refuse" or "drop" triangles with a NaN or infinite vertex.
        """
        config = _umbel.KdTreeConfig()
        if invalid not in ("refuse", "drop"):
            raise Error(f"invalid must be 'refuse' or 'drop', not {invalid!r}")
        config.drop_invalid = invalid == "drop"
        config.compact = bool(compact)
        options = {
            "builder": builder,
            "traversal": _traversal(ropes, traversal),
            "cost": cost,
            "empty_bonus": empty_bonus,
            "max_depth": max_depth,
            "bad_refines": bad_refines,
            "max_references": max_references,
            "bins": bins,
            "target_leaf_size": target_leaf_size,
        }
        configure(config, options)
        mesh = mesh_from(positions, triangles)
        with about(mesh):
            self._native = _umbel.KdTree.build(
                geometry_of(mesh),
                config,
                mask_array(masks, len(mesh.triangles)),
                progress,
                thread_count(threads),
            )
        self._origin = origin_of(mesh.origin)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        ropes: bool = False,
        *,
        traversal: str | None = None,
        origin: ArrayLike = (0.0, 0.0, 0.0),
    ) -> KdTree:
        """Reads what `save` wrote; a file that is not whole is refused. `origin` is that of the
        tree that was saved, which the file does not hold."""
        self = cls.__new__(cls)
        self._origin = origin_of(origin)
        way = _traversal(ropes, traversal)
        self._native = _umbel.KdTree.load(os.fspath(path), way)
        return self

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a `.umkd` file, beside its name first, so that no half file is left. Ropes are
        not kept. Warns where there is an origin, which is not either."""
        self._native.save(os.fspath(path))
        warn_of_origin(path, self._origin)

    @property
    def traversal(self) -> str:
        """ "stack", "ropes" or "short-stack"; may be changed."""
        return self._native.traversal

    @traversal.setter
    def traversal(self, name: str) -> None:
        self._native.traversal = _traversal(False, name)

    def __repr__(self) -> str:
        return f"<KdTree: {len(self)} triangles, {self._native.statistics()['nodes']} nodes>"
