"""What commands do with `--device cuda`: arrays go to the device and come back."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from umbel.errors import Error

if TYPE_CHECKING:
    from umbel.accel.queries import TriangleQueries
    from umbel.cluster.clusters import Clusters
    from umbel.cuda.bvh import Bvh
    from umbel.geometry.mesh import Mesh

BUILDERS = {"fast": "lbvh", "quality": "hploc", "best": "atrbvh"}
"""What a device builds for the presets of the processor."""

SETTINGS = {
    "hlbvh_bits": "hlbvh_bits",
    "clusters": "kmeans_clusters",
    "candidates": "kmeans_candidates",
    "iterations": "kmeans_iterations",
    "distance": "kmeans_manhattan",
    "forwarded_clusters": "kmeans_forwarded_clusters",
    "ploc_radius": "ploc_radius",
    "treelet_size": "treelet_size",
    "treelet_rounds": "treelet_rounds",
}
"""The device's names of the options that it has."""


def cluster_on_device(
    mesh: Mesh,
    method: str,
    max_triangles: int,
    min_triangles: int | None,
    max_vertices: int,
    underfill_cost: float | None,
    threads: int,
) -> Clusters:
    """As cluster_mesh, by the methods that a device has. What is None has the device's default."""
    from umbel.cluster.clusters import clusters_of
    from umbel.cuda import FrameClusters

    settings = {"min_triangles": min_triangles, "underfill_cost": underfill_cost}
    found = FrameClusters(
        mesh.positions,
        mesh.triangles,
        method,
        max_triangles=max_triangles,
        max_vertices=max_vertices,
        **{name: value for name, value in settings.items() if value is not None},  # type: ignore[arg-type]
    ).arrays
    count = int(found["count"][0])
    return clusters_of(
        mesh,
        found["items"].view("uint32"),
        found["offsets"][: count + 1].view("uint32"),
        max_triangles,
        threads=threads,
    )


def check_device(options: dict[str, Any] | None = None) -> None:
    """Refuses options of `umbel bvh` that a device does not have, and a library that is not
    there."""
    from umbel.cuda.calls import library

    for name, value in (options or {}).items():
        if value is not None and name not in (*SETTINGS, "cost", "max_leaf_size"):
            raise Error(f"--device cuda has no --{name.replace('_', '-')}")
    library()


def bvh_on_device(
    mesh: Mesh, builder: str, options: dict[str, Any], threads: int
) -> dict[str, Any]:
    """What `umbel bvh` says of a tree that a device builds. All times are from NumPy arrays to
    NumPy arrays."""
    import numpy as np

    from umbel.cli.structures import ray_speeds
    from umbel.cuda import Bvh

    given = {name: value for name, value in options.items() if value is not None}
    (traversal, intersection), most = given.pop("cost"), given.pop("max_leaf_size")
    if "distance" in given:
        given["distance"] = int(given["distance"] == "manhattan")
    settings = {SETTINGS[name]: value for name, value in given.items()}
    settings |= {
        "traversal_cost": traversal,
        "intersection_cost": intersection,
        "max_leaf_size": most,
    }
    seconds = 0.0
    for _ in range(2):  # the first build starts the device
        began = time.perf_counter()
        tree = Bvh(mesh.positions, mesh.triangles, BUILDERS.get(builder, builder), **settings)
        info = tree.info()
        seconds = time.perf_counter() - began
    nodes = tree.arrays["nodes"][: info.nodes]
    leaves, depth = _shape_of(nodes)
    found = {
        "width": 8,
        "nodes": info.nodes,
        "leaves": leaves,
        "max_depth": depth,
        "references": info.triangles,
        "sah_cost": info.sah_cost,
        "epo": None,
        "build_seconds": seconds,
        "widen_seconds": 0.0,
        "wide_nodes": info.nodes,
        "bytes": nodes.nbytes + info.triangles * tree.arrays["triangles"].shape[1],
    }
    queries: Any = _Queries(tree, np.array(info.bounds, np.float32) if info.nodes else None)
    answers: TriangleQueries = queries
    return found | ray_speeds(answers, mesh, threads)


class _Queries:
    """Rays on a device, as a structure of the processor takes them."""

    def __init__(self, tree: Bvh, bounds: Any) -> None:
        self._tree, self.bounds = tree, bounds

    def intersect(self, origins: Any, directions: Any, *, threads: int) -> SimpleNamespace:
        return SimpleNamespace(**self._tree.intersect(origins, directions))


def _shape_of(nodes: Any) -> tuple[int, int]:
    """Leaves, and levels of nodes. compact_bvh.hpp says what the bytes are."""
    import numpy as np

    meta = nodes[:, 24:32]
    first = np.ascontiguousarray(nodes[:, 16:20]).view("<u4")[:, 0].astype(np.int64)
    inner = (meta == 0x80).sum(axis=1)
    depth = 0
    level = np.arange(min(len(nodes), 1))
    while len(level):
        depth += 1
        counts = inner[level]
        before = np.cumsum(counts) - counts
        level = np.repeat(first[level] - before, counts) + np.arange(counts.sum())
    return int(((meta > 0) & (meta <= 8)).sum()), depth
