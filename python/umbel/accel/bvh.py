"""Bounding volume hierarchies over triangles: rays, distances and overlaps."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.accel.inputs import geometry_of, mesh_from
from umbel.accel.queries import TriangleQueries
from umbel.accel.rays import mask_array
from umbel.accel.tree_options import TreeOptions, tree_config
from umbel.accel.trees import Bvh2, KaryTree
from umbel.errors import Error
from umbel.geometry.arrays import about, check_affine, indices, native, numbers, rows, thread_count
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import origin_of, warn_of_origin
from umbel.geometry.repair import Progress

if TYPE_CHECKING:
    from typing_extensions import Unpack


@dataclass(frozen=True)
class Refit:
    """What became of a hierarchy that followed moved vertices."""

    sah_cost: float
    """Of a `Bvh` an estimate, by how much the cost of its wide tree has grown."""
    built_sah_cost: float
    """When the tree was built."""
    rebuild_advised: bool
    """Whether the cost has grown so much that a new build would pay."""


class Bvh(TriangleQueries):
    """A hierarchy over triangles that answers rays, distances and overlaps. It holds all that it
    needs: the mesh need not be kept. Only its array of triangles is shared, for `refit`, and, with
    `keep_tree`, that of its positions, for `epo`; they must not be changed."""

    _native: _umbel.Bvh

    def __init__(
        self,
        positions: Any,
        triangles: ArrayLike | None = None,
        builder: str = "quality",
        width: int = 8,
        threads: int = 0,
        *,
        compact: bool = False,
        masks: ArrayLike | None = None,
        simd: str = "auto",
        keep_tree: bool = False,
        progress: Progress | None = None,
        **options: Unpack[TreeOptions],
    ) -> None:
        """
        positions: (n, 3), with triangles (m, 3); or, alone, a mesh: an `umbel.Mesh`, the path of a
            file, anything with .vertices and .faces, a pair (positions, triangles).
        builder: a preset, "fast", "quality" or "best"; one of `umbel.bvh.builders()`; or settings
            that a paper names, "kmeans-q1" to "kmeans-q5", "aac-fast" or "aac-hq".
        width: children a node, 2, 4 or 8.
        compact: share vertices between triangles, and keep boxes in 16 bits a plane: little more
            than half of the memory, slower rays.
        masks: (m,) bits of each triangle; a query sees those that share a bit with its mask.
        simd: "auto", "portable", "avx2" or "avx512"; results are the same for all.
        keep_tree: keep the binary tree too, for `tree` and `epo`.
        options: those of the tree, see `umbel.bvh.TreeOptions`.
        """
        config = tree_config(builder, options)
        mesh = mesh_from(positions, triangles)
        geometry = geometry_of(mesh)
        form = (_width(width), bool(compact), str(simd), mask_array(masks, len(mesh.triangles)))
        self.tree: Bvh2 | None = None
        """The binary tree, where it was kept."""
        with about(mesh):
            if keep_tree:
                made = _umbel.build_bvh2_mesh(geometry, config, progress, thread_count(threads))
                self.tree = Bvh2(made, config, geometry)
                self._native = _umbel.Bvh.widen(
                    made, geometry, config, *form, threads=thread_count(threads)
                )
            else:
                self._native = _umbel.Bvh.build(
                    geometry, config, *form, progress=progress, threads=thread_count(threads)
                )
        self._triangles: NDArray[np.uint32] | None = mesh.triangles
        self._origin = origin_of(mesh.origin)

    @classmethod
    def _of(
        cls,
        bvh: _umbel.Bvh,
        triangles: NDArray[np.uint32] | None,
        tree: Bvh2 | None = None,
        origin: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Bvh:
        self = cls.__new__(cls)
        self._origin = origin_of(origin)
        self._native = bvh
        self.tree = tree
        self._triangles = triangles
        return self

    @classmethod
    def from_tree(
        cls,
        tree: Bvh2 | KaryTree,
        positions: Any,
        triangles: ArrayLike | None = None,
        width: int = 8,
        threads: int = 0,
        *,
        compact: bool = False,
        masks: ArrayLike | None = None,
        simd: str = "auto",
        progress: Progress | None = None,
    ) -> Bvh:
        """The hierarchy that a tree over the triangles of this mesh becomes. Of a `KaryTree` nodes
        with no more children than `width` stay as they are."""
        if not isinstance(tree, (Bvh2, KaryTree)):
            raise Error(f"tree must be a Bvh2 or a KaryTree, not a {type(tree).__name__}")
        mesh = mesh_from(positions, triangles)
        bvh = _umbel.Bvh.widen(
            tree._native,
            geometry_of(mesh),
            tree._config,
            _width(width),
            bool(compact),
            str(simd),
            masks=mask_array(masks, len(mesh.triangles)),
            progress=progress,
            threads=thread_count(threads),
        )
        kept = tree if isinstance(tree, Bvh2) else None
        return cls._of(bvh, mesh.triangles, kept, mesh.origin)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        simd: str = "auto",
        origin: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Bvh:
        """Reads what `save` wrote; a file that is not whole is refused. `origin` is that of the
        hierarchy that was saved, which the file does not hold."""
        return cls._of(_umbel.Bvh.load(os.fspath(path), str(simd)), None, origin=origin)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a `.umbvh` file, beside its name first, so that no half file is left. Warns where
        there is an origin, which the file does not hold."""
        self._native.save(os.fspath(path))
        warn_of_origin(path, self._origin)

    def refit(
        self,
        positions: ArrayLike,
        triangles: ArrayLike | None = None,
        *,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> Refit:
        """Follows moved vertices: (n, 3) new positions of the same triangles. `triangles` is only
        needed after `load`. No other thread may use the hierarchy meanwhile."""
        same = self._triangles if triangles is None else indices("triangles", triangles, 3)
        if same is None:
            raise Error("triangles must be given to refit a hierarchy that was loaded from a file")
        arrays = native(Mesh(rows("positions", self._local("positions", positions), 3), same))
        report = Refit(*self._native.refit(arrays, progress, thread_count(threads)))
        self._triangles = same
        self.tree = None  # its boxes are those of the old positions
        return report

    def collide(
        self, other: Bvh, transform: ArrayLike | None = None, *, threads: int = 0
    ) -> NDArray[np.int32]:
        """(k, 2) the pairs of a triangle of this mesh and one of the other that have a point in
        common, sorted. Decided exactly: triangles that only touch, also in one plane, count.
        Surfaces collide, not what they enclose. `transform`, (4, 4) or (3, 4), places the other
        mesh; its corners are mapped in double and rounded to floats."""
        pose = self._pose_of(other, transform)
        return self._native.collide(other._native, pose, thread_count(threads))

    def collides(self, other: Bvh, transform: ArrayLike | None = None, *, threads: int = 0) -> bool:
        """Whether there is such a pair; stops at the first that is found."""
        pose = self._pose_of(other, transform)
        return self._native.collides(other._native, pose, thread_count(threads))

    def _pose_of(self, other: Bvh, transform: ArrayLike | None) -> list[float]:
        """The map from the other mesh's local coordinates to this one's, row by row."""
        if not isinstance(other, Bvh):
            raise Error(f"other must be a Bvh, not a {type(other).__name__}")
        rows = np.eye(4) if transform is None else numbers("transform", transform)
        if rows.shape not in ((4, 4), (3, 4)):
            raise Error(f"transform must have shape (4, 4) or (3, 4), not {rows.shape}")
        check_affine("transform", rows)
        if not np.isfinite(rows).all():
            raise Error("transform must be finite")
        local = rows[:3].astype(np.float64)
        local[:, 3] += local[:, :3] @ other._origin - self._origin
        return [float(x) for x in local.ravel()]

    def statistics(self) -> dict[str, Any]:
        """`width nodes leaves max_depth references sah_cost bytes`."""
        return self._native.statistics()

    @property
    def sah_cost(self) -> float:
        """Expected cost of a random line through the tree that this was made from; after a refit
        the estimate of `Refit`."""
        return float(self._native.statistics()["sah_cost"])

    @property
    def epo(self) -> float:
        """End-point overlap of the binary tree, which must have been kept: see `Bvh2.epo`."""
        if self.tree is None:
            raise Error("epo needs the binary tree: build with keep_tree=True")
        return self.tree.epo()

    def __repr__(self) -> str:
        found = self._native.statistics()
        return f"<Bvh: {len(self)} triangles, {found['nodes']} nodes of {found['width']}>"


def _width(width: int) -> int:
    if getattr(width, "ndim", 0) or width not in (2, 4, 8):
        raise Error(f"width must be 2, 4 or 8, not {width!r}")
    return int(width)
