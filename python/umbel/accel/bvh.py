"""Bounding volume hierarchies: rays, distances and overlaps over triangles, and the trees of every
builder."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.accel.queries import TriangleQueries
from umbel.accel.rays import mask_array
from umbel.errors import Error
from umbel.geometry.arrays import about, array_of, as_mesh, indices, native, rows, thread_count
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import localize, origin_of, warn_of_origin
from umbel.geometry.repair import Progress

if TYPE_CHECKING:
    from typing_extensions import Unpack

PRESETS = ("fast", "quality", "best")
DISTANCES = ("euclidean", "manhattan")


class TreeOptions(TypedDict, total=False):
    """How a tree is built; what is left out, or None, is as the preset or builder has it."""

    cost: tuple[float, float] | None
    """(traversal, intersection) of the surface-area heuristic."""
    max_leaf_size: int | None
    """Most triangles a leaf, 1 to 255."""
    max_depth: int | None
    """Deepest level of a leaf, 8 to 255."""
    invalid: Literal["refuse", "drop"] | None
    """What to do with triangles that have a NaN or infinite vertex."""
    reinsertion_rounds: int | None
    """Rounds of reinsertion after any builder, 0 to 64."""
    bins: int | None
    """binned: bins an axis, 4 to 256."""
    spatial_budget: float | None
    """sbvh: references beyond the mesh's triangles, as a fraction, 0 to 4."""
    spatial_overlap: float | None
    """sbvh: the overlap from which on spatial splits are tried, 0 to 1."""
    morton_bits: int | None
    """lbvh: 30 or 63."""
    hlbvh_bits: int | None
    """hlbvh: leading bits of the code that are built by SAH, 3 to 30."""
    ploc_radius: int | None
    """ploc: neighbours searched each way, 1 to 128."""
    ploc_sweep: int | None
    """ploc: the tree above clusters of at most so many triangles is also swept, and the cheaper one
    kept, 0 to 255; 0 as published."""
    atrbvh_bits: int | None
    """atrbvh: as hlbvh_bits, of the tree to begin with, 3 to 30; 0: a plain lbvh, as published."""
    treelet_size: int | None
    """atrbvh: leaves of a treelet, 3 to 15."""
    treelet_rounds: int | None
    """atrbvh: 1 to 16."""
    clusters: int | None
    """kmeans: k, 2 to 64."""
    candidates: int | None
    """kmeans: p, 1 to 64."""
    iterations: int | None
    """kmeans: i, 0 to 100."""
    distance: Literal["euclidean", "manhattan"] | None
    """kmeans: of the boxes' corners; with "manhattan", medians instead of means."""
    handed_up: int | None
    """kmeans: subtrees that a node's treelet hands up, 0 to 64; 1 is the algorithm as published,
    0 as many as a treelet can take."""
    aac_leaf_size: int | None
    """aac: fewer triangles are not halved any more, 2 to 128."""
    aac_epsilon: float | None
    """aac: n triangles hand up some n^(0.5 - epsilon) nodes, 0 to 0.5."""


NODE = np.dtype([("min", "<f4", 3), ("first", "<u4"), ("max", "<f4", 3), ("count", "<u4")])
"""A node of a `Bvh2`."""

KARY_NODE = np.dtype(
    [("min", "<f4", 3), ("first", "<u4"), ("max", "<f4", 3), ("children", "<u2"), ("count", "<u2")]
)
"""A node of a `KaryTree`."""


def builders() -> tuple[str, ...]:
    """The names of all builders that the library was built with."""
    return tuple(_umbel.bvh_builders())


@dataclass(frozen=True)
class Refit:
    """What became of a hierarchy that followed moved vertices."""

    sah_cost: float
    built_sah_cost: float
    """When the tree was built."""
    rebuild_advised: bool
    """Whether the cost has grown so much that a new build would pay."""


def _config(builder: str, options: TreeOptions) -> _umbel.BvhConfig:
    """The config of a preset or of a builder, with what is not None in `options`."""
    unknown = next((name for name in options if name not in TreeOptions.__annotations__), None)
    if unknown is not None:
        raise TypeError(f"there is no option {unknown!r}")
    changes = {name: value for name, value in options.items() if value is not None}
    config = _preset(builder)
    config.drop_invalid = _choice("invalid", changes, ("refuse", "drop")) == "drop"
    if "distance" in changes:
        config.manhattan = _choice("distance", changes, DISTANCES) == "manhattan"
    for name, value in changes.items():
        try:
            setattr(config, name, value)
        except (TypeError, RuntimeError):
            raise Error(f"{name} cannot be {value!r}") from None
    return config


def _preset(name: str) -> _umbel.BvhConfig:
    if not isinstance(name, str):
        raise Error(f"builder must be a name, not {name!r}")
    if name in PRESETS:
        return _umbel.bvh_preset(name)
    if name.partition("-")[0] not in builders():
        names = ", ".join((*PRESETS, *builders()))
        raise Error(f"builder is {name!r}, but must be one of {names}")
    return _umbel.bvh_builder_preset(name)


def _choice(name: str, changes: dict[str, Any], values: tuple[str, ...]) -> str:
    """Takes an option out of `changes`; the first of its values where it is not there."""
    value = changes.pop(name, values[0])
    if value not in values:
        raise Error(f"{name} must be {' or '.join(map(repr, values))}, not {value!r}")
    return str(value)


def _mesh_of(positions: Any, triangles: ArrayLike | None) -> Mesh:
    if triangles is None:
        return as_mesh(positions)
    points = array_of("positions", positions)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        return Mesh(points, triangles)  # type: ignore[arg-type]
    origin, local = localize(points)  # what rounding loses is no matter of a hierarchy
    return Mesh(local, triangles, origin=origin)  # type: ignore[arg-type]


def _geometry(mesh: Mesh) -> _umbel.MeshArrays:
    """Positions and triangles alone: attributes are no matter of a hierarchy."""
    return native(Mesh(mesh.positions, mesh.triangles))


class Bvh2:
    """A binary tree, as a builder gave it. `nodes[0]` is the root, and children come after their
    parent. Made by `build_bvh2`."""

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

    @property
    def primitives(self) -> NDArray[np.uint32]:
        """(p,) in the order of the leaves: each box or triangle once, or, with spatial splits, at
        least once. A read-only view."""
        return self._native.primitives

    def statistics(self, cost: tuple[float, float] | None = None) -> dict[str, Any]:
        """`nodes leaves max_depth references sah_cost bytes`."""
        return self._native.statistics(*(cost or self._config.cost))

    def sah_cost(self, cost: tuple[float, float] | None = None) -> float:
        """Expected cost of a random line, for (traversal, intersection) costs; those of the build
        where None."""
        return float(self.statistics(cost)["sah_cost"])

    def epo(self, cost: tuple[float, float] | None = None, *, threads: int = 0) -> float:
        """End-point overlap (Aila, Karras & Laine 2013); only for trees over triangles."""
        if self._mesh is None:
            raise Error("epo needs triangles, and this tree was built over boxes")
        costs = cost or self._config.cost
        return self._native.end_point_overlap(self._mesh, *costs, threads=thread_count(threads))

    def __repr__(self) -> str:
        return f"<Bvh2: {len(self._native.nodes)} nodes, {len(self._native.primitives)} primitives>"


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
    config = _config(builder, options)
    boxes = None if triangles is not None else _boxes_of(source)
    if boxes is not None:
        tree = _umbel.build_bvh2_boxes(boxes, config, progress, thread_count(threads))
        return Bvh2(tree, config, None)
    mesh = _geometry(_mesh_of(source, triangles))
    return Bvh2(_umbel.build_bvh2_mesh(mesh, config, progress, thread_count(threads)), config, mesh)


class KaryTree:
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

    @property
    def primitives(self) -> NDArray[np.uint32]:
        """(p,) in the order of the leaves, each box or triangle once. A read-only view."""
        return self._native.primitives

    def statistics(self, cost: tuple[float, float] | None = None) -> dict[str, Any]:
        """`nodes leaves max_depth references sah_cost bytes`."""
        return self._native.statistics(*(cost or self._config.cost))

    def sah_cost(self, cost: tuple[float, float] | None = None) -> float:
        """Expected cost of a random line, for (traversal, intersection) costs, where a visit of a
        node costs the same whatever its number of children."""
        return float(self.statistics(cost)["sah_cost"])

    def __repr__(self) -> str:
        return f"<KaryTree: {len(self.nodes)} nodes, {len(self.primitives)} primitives>"


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
    config = _config(builder, options)
    if config.builder != "kmeans":
        raise Error(f"builder must be kmeans or one of its settings, not {builder!r}")
    boxes = None if triangles is not None else _boxes_of(source)
    count = thread_count(threads)
    if boxes is not None:
        return KaryTree(_umbel.build_kary_boxes(boxes, config, progress, count), config)
    mesh = _geometry(_mesh_of(source, triangles))
    return KaryTree(_umbel.build_kary_mesh(mesh, config, progress, count), config)


def kmeans_times(
    source: Any, *, progress: Progress | None = None, **options: Unpack[TreeOptions]
) -> dict[str, float]:
    """Where the time of the builder kmeans goes, on one thread over a mesh: wall-clock seconds of
    `boxes`, `seeding`, `iterations`, `sizes`, `reordering` and `agglomeration`."""
    config = _config("kmeans", options)
    return _umbel.kmeans_times(_geometry(as_mesh(source)), config, progress)


def _boxes_of(source: Any) -> NDArray[np.float32] | None:
    """The boxes, if `source` is an array of them and not a mesh."""
    if isinstance(source, (str, os.PathLike, Mesh)) or hasattr(source, "faces"):
        return None
    if isinstance(source, (tuple, list)) and len(source) == 2 and np.ndim(source[0]) == 2:
        return None  # (positions, triangles)
    return rows("boxes", source, 6)


class Bvh(TriangleQueries):
    """A hierarchy over triangles that answers rays, distances and overlaps. It holds all that it
    needs: the mesh need not be kept."""

    _native: _umbel.TriangleBvh

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
        config = _config(builder, options)
        mesh = _mesh_of(positions, triangles)
        geometry = _geometry(mesh)
        form = (_width(width), bool(compact), str(simd), mask_array(masks, len(mesh.triangles)))
        self.tree: Bvh2 | None = None
        """The binary tree, where it was kept."""
        with about(mesh):
            if keep_tree:
                made = _umbel.build_bvh2_mesh(geometry, config, progress, thread_count(threads))
                self.tree = Bvh2(made, config, geometry)
                self._native = _umbel.TriangleBvh.widen(
                    made, geometry, config, *form, threads=thread_count(threads)
                )
            else:
                self._native = _umbel.TriangleBvh.build(
                    geometry, config, *form, progress=progress, threads=thread_count(threads)
                )
        self._triangles: NDArray[np.uint32] | None = mesh.triangles
        self._origin = mesh.origin

    @classmethod
    def _of(
        cls,
        bvh: _umbel.TriangleBvh,
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
        mesh = _mesh_of(positions, triangles)
        bvh = _umbel.TriangleBvh.widen(
            tree._native,
            _geometry(mesh),
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
        return cls._of(_umbel.TriangleBvh.load(os.fspath(path), simd), None, origin=origin)

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

    def statistics(self) -> dict[str, Any]:
        """`width nodes leaves max_depth references sah_cost bytes`."""
        return self._native.statistics()

    @property
    def sah_cost(self) -> float:
        """Expected cost of a random line through the tree that this was made from."""
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
    if width not in (2, 4, 8):
        raise Error(f"width must be 2, 4 or 8, not {width!r}")
    return int(width)
