"""Clusters of meshes that change every frame: the same triangles, new positions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from umbel import _umbel
from umbel.cluster.area_growth import AreaGrowth, RebuildPolicy
from umbel.geometry.arrays import (
    as_mesh,
    indices,
    number,
    numbers,
    rows,
    thread_count,
    whole,
)
from umbel.geometry.origin import origin_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class FrameClusters:
    """Clusters of one mesh through its frames.

    mesh: a mesh, a path, or anything with .vertices and .faces; its positions are the first frame.
    method: "morton" (runs in Morton order, the fastest) or "hybrid" (blocks of that order,
        bisected: a third of the area).
    max_triangles: of a cluster, up to 512.
    min_triangles: hybrid only; 0 for a quarter of max_triangles.
    max_vertices: of a cluster, 3 to 256; 0 for no limit.
    underfill_cost: hybrid only, in [0, 4]: the penalty for triangles missing to full clusters.
    code_bits: of the Morton codes, 30 or 63; 0 chooses by the number of triangles.
    """

    def __init__(
        self,
        mesh: Any,
        method: str = "hybrid",
        *,
        max_triangles: int = 128,
        min_triangles: int = 0,
        max_vertices: int = 0,
        underfill_cost: float = 1.0,
        code_bits: int = 0,
        threads: int = 0,
    ) -> None:
        source = as_mesh(mesh)
        self.origin = origin_of(source.origin)
        """What boxes are relative to; frames' positions are in the world."""
        self._threads = thread_count(threads)
        self._native = _umbel.FrameClusterer(
            indices("triangles", source.triangles, 3),
            len(source.positions),
            str(method),
            whole("max_triangles", max_triangles),
            whole("min_triangles", min_triangles),
            whole("max_vertices", max_vertices),
            number("underfill_cost", underfill_cost),
            whole("code_bits", code_bits),
        )
        self.build(source.world_positions if self.origin.any() else source.positions)

    def __len__(self) -> int:
        return int(self._native.count())

    def build(self, positions: ArrayLike) -> None:
        """Clusters of these positions alone, without the last frame's order."""
        self._native.build(self._positions(positions), self._threads)

    def update(self, positions: ArrayLike) -> None:
        """As `build`, but triangles with equal codes keep the last frame's order."""
        self._native.update(self._positions(positions), self._threads)

    def refit(self, positions: ArrayLike) -> AreaGrowth:
        """Keeps the clusters and computes their boxes again."""
        return AreaGrowth(*self._native.refit(self._positions(positions), self._threads))

    def rebuild_worst(self, positions: ArrayLike, clusters: int) -> AreaGrowth:
        """Refits, and rebuilds up to `clusters` of those that have grown the most."""
        return AreaGrowth(
            *self._native.rebuild_worst(
                self._positions(positions), whole("clusters", clusters), self._threads
            )
        )

    def step(self, positions: ArrayLike, policy: RebuildPolicy, frames: int) -> str:
        """Refits, asks the policy, `frames` after the last rebuild, and does what it says; tells
        what that was."""
        action = policy.decide(self.refit(positions), frames)
        if action == "rebuild":
            self.build(positions)
        elif action == "rebuild_worst":
            self.rebuild_worst(positions, max(1, round(policy.budget * len(self))))
        return action

    @property
    def area_growth(self) -> AreaGrowth:
        """As last measured."""
        return AreaGrowth(*self._native.area_growth())

    @property
    def items(self) -> NDArray[np.uint32]:
        """(m,) triangle indices, in cluster order."""
        return self._native.items()

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """(m, 3) the same triangles: a new index buffer."""
        return self._native.triangles()

    @property
    def offsets(self) -> NDArray[np.uint32]:
        """(k + 1,) cluster c has the triangles [offsets[c], offsets[c + 1])."""
        return self._native.offsets()

    @property
    def boxes(self) -> NDArray[np.float32]:
        """(k, 6) minima and maxima."""
        return self._native.boxes()

    def vertex_lists(
        self,
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint8]]:
        """(k + 1,) offsets into (v,) mesh vertices of each cluster, and (m, 3) corners of each
        triangle among its cluster's vertices. Needs clusters of at most 256 vertices."""
        return _umbel.list_frame_vertices(self._native, self._threads)

    def _positions(self, positions: ArrayLike) -> NDArray[np.float32]:
        array = numbers("positions", positions)
        if self.origin.any() and array.ndim == 2 and array.shape[1] == 3:
            array = array.astype(np.float64) - self.origin
        return rows("positions", array, 3)
