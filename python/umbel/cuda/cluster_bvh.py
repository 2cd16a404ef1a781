"""Hierarchies over the clusters of a mesh that changes every frame, on a CUDA device."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

from umbel.cuda.bvh import Bvh
from umbel.cuda.calls import MeshStruct

if TYPE_CHECKING:
    from umbel.cuda.frame_clusters import FrameClusters


class ClusterBvh(Bvh):
    """A hierarchy with a subtree for every cluster: FrameClusters.bvh makes it.

    `build` takes the clusters as they are then; `refit` keeps the nodes. Both go into the stream of
    the clusters' own calls, or one that waits for it. Hits name triangles of the mesh. With
    "lbvh" each cluster is a subtree; "atrbvh" and "hploc" start from that.
    """

    def __init__(
        self, clusters: FrameClusters, positions: Any, builder: str = "lbvh", **options: Any
    ) -> None:
        self._clusters = clusters
        super().__init__(positions, clusters.source, builder, **options)

    def _build(self, mesh: MeshStruct, stream: int) -> None:
        config, clusters = self._clusters.as_arguments()
        self._scratch.call(
            "umbel_cuda_build_cluster_bvh",
            ctypes.byref(mesh),
            ctypes.byref(config),
            ctypes.byref(clusters),
            ctypes.byref(self._config),
            ctypes.byref(self._struct()),
            stream=stream,
        )
