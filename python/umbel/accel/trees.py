"""Trees as their builders make them: binary ones, and the k-ary ones of k-means."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.accel.inputs import boxes_from, geometry_of, mesh_from
from umbel.accel.tree_options import TreeOptions, tree_config
from umbel.errors import Error
from umbel.geometry.arrays import about, as_mesh, numbers, thread_count
from umbel.geometry.repair import Progress

if TYPE_CHECKING:
    from typing_extensions import Unpack

NODE = np.dtype([("min", "<f4", 3), ("first", "<u4"), ("max", "<f4", 3), ("count", "<u4")])
"""A node of a `Bvh2`."""

KARY_NODE = np.dtype(
    [("min", "<f4", 3), ("first", "<u4"), ("max", "<f4", 3), ("children", "<u2"), ("count", "<u2")]
)
"""A node of a `KaryTree`."""


class _Tree:
    """What both kinds of trees have."""

    _native: _umbel.Bvh2 | _umbel.KaryTree
    _config: _umbel.BvhConfig

    @property
    def primitives(self) -> NDArray[np.uint32]:
        """(p,) in the order of the leaves: each box or triangle once, or, with spatial splits, at
        least once. A read-only view."""
        return self._native.primitives

    def statistics(self, cost: tuple[float, float] | None = None) -> dict[str, Any]:
        """`nodes leaves max_depth references sah_cost bytes`."""
        return self._native.statistics(*self._costs(cost))

    def sah_cost(self, cost: tuple[float, float] | None = None) -> float:
        """Expected cost of a random line, for (traversal, intersection) costs; those of the build
        where None. A visit of a node costs the same for any number of children."""
        return float(self.statistics(cost)["sah_cost"])

    def _costs(self, cost: tuple[float, float] | None) -> tuple[float, float]:
        if cost is None:
            return self._config.cost
        costs = numbers("cost", cost)
        if costs.shape != (2,) or not (np.isfinite(costs) & (costs >= 0)).all():
            raise Error(f"cost must be two finite numbers from 0 on, not {cost!r}")
        return float(costs[0]), float(costs[1])

    def __repr__(self) -> str:
        nodes, primitives = len(self._native.nodes), len(self.primitives)
        return f"<{type(self).__name__}: {nodes} nodes, {primitives} primitives>"


class Bvh2(_Tree):
    """A binary tree, as a builder gave it. `nodes[0]` is the root, and children come after their
    parent. Made by `build_bvh2`."""

    _native: _umbel.Bvh2

    def __init__(
        self,
        tree: _umbel.Bvh2,
        config: _umbel.BvhConfig,
        mesh: _umbel.MeshArrays | None,
    ) -> None:
        self._native = tree
        self._config = config
        self._mesh = mesh

    @property
    def nodes(self) -> NDArray[Any]:
        """(n,) `min first max count`, a read-only view. A leaf has `count` primitives from
        `primitives[first]` on; an inner node has count 0 and the children first and first + 1."""
        words = self._native.nodes
        return words.view(NODE).reshape(len(words))

    def epo(self, cost: tuple[float, float] | None = None, *, threads: int = 0) -> float:
        """End-point overlap (Aila, Karras & Laine 2013); only for trees over triangles. The mesh's
        arrays are shared, and must be as they were when the tree was built."""
        if self._mesh is None:
            raise Error("epo needs triangles, and this tree was built over boxes")
        return self._native.end_point_overlap(
            self._mesh, *self._costs(cost), threads=thread_count(threads)
        )


def build_bvh2(
    source: Any,
    triangles: ArrayLike | None = None,
    *,
    builder: str = "quality",
    progress: Progress | None = None,
    threads: int = 0,
    **options: Unpack[TreeOptions],
) -> Bvh2:
    """A binary tree over a mesh (as `umbel.Bvh` takes it), or over (n, 6) boxes: min x, y, z,
    max x, y, z of each. The other arguments are those of `umbel.Bvh`."""
    config = tree_config(builder, options)
    boxes = None if triangles is not None else boxes_from(source)
    if boxes is not None:
        tree = _umbel.build_bvh2_boxes(boxes, config, progress, thread_count(threads))
        return Bvh2(tree, config, None)
    mesh = mesh_from(source, triangles)
    geometry = geometry_of(mesh)
    with about(mesh):
        tree = _umbel.build_bvh2_mesh(geometry, config, progress, thread_count(threads))
    return Bvh2(tree, config, geometry)


class KaryTree(_Tree):
    """The clusters of k-means with up to k children a node, before they become a binary tree.
    `nodes[0]` is the root, and children come after their parent. Made by `build_kary`."""

    def __init__(self, tree: _umbel.KaryTree, config: _umbel.BvhConfig) -> None:
        self._native = tree
        self._config = config

    @property
    def nodes(self) -> NDArray[Any]:
        """(n,) `min first max children count`, a read-only view. A leaf has `count` primitives from
        `primitives[first]` on, and no children; an inner node has `children` from `first` on."""
        words = self._native.nodes
        return words.view(KARY_NODE).reshape(len(words))


def build_kary(
    source: Any,
    triangles: ArrayLike | None = None,
    *,
    builder: str = "kmeans",
    progress: Progress | None = None,
    threads: int = 0,
    **options: Unpack[TreeOptions],
) -> KaryTree:
    """The tree of k-means clusters over a mesh or boxes, taken as by `build_bvh2`. `builder` is
    "kmeans" or "kmeans-q1" to "kmeans-q5"; of the options those of kmeans count, `max_leaf_size`,
    `cost` and `invalid`. `Bvh.from_tree` traces it."""
    config = tree_config(builder, options)
    if config.builder != "kmeans":
        raise Error(f"builder must be kmeans or one of its settings, not {builder!r}")
    boxes = None if triangles is not None else boxes_from(source)
    count = thread_count(threads)
    if boxes is not None:
        return KaryTree(_umbel.build_kary_boxes(boxes, config, progress, count), config)
    mesh = mesh_from(source, triangles)
    with about(mesh):
        tree = _umbel.build_kary_mesh(geometry_of(mesh), config, progress, count)
    return KaryTree(tree, config)


def kmeans_times(
    source: Any, *, progress: Progress | None = None, **options: Unpack[TreeOptions]
) -> dict[str, float]:
    """Where the time of the builder kmeans goes, on one thread over a mesh: wall-clock seconds of
    `boxes`, `seeding`, `iterations`, `sizes`, `reordering` and `agglomeration`."""
    config = tree_config("kmeans", options)
    mesh = as_mesh(source)
    with about(mesh):
        return _umbel.kmeans_times(geometry_of(mesh), config, progress)
