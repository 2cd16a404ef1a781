"""What commands measure besides what the library says: files, tables."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from umbel.lod.tables import Tables


def sha256_of(path: str | Path) -> str:
    """The file's SHA-256, in hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def table_counts(meshes: Sequence[Tables], max_triangles: int) -> dict[str, Any]:
    """What the tables of meshes say about them."""
    import numpy as np

    counts = []
    for tables in meshes:
        clusters, groups = tables.clusters, tables.groups
        in_root = np.isinf(groups["error"])[clusters["group"]]
        counts.append(
            {
                "levels": len(tables.levels),
                "groups": len(groups),
                "clusters": len(clusters),
                "triangles": int(clusters["triangle_count"].sum(dtype=np.int64)),
                "root_groups": int(np.isinf(groups["error"]).sum()),
                "root_clusters": int(in_root.sum()),
                "root_triangles": int(clusters["triangle_count"][in_root].sum(dtype=np.int64)),
                "max_triangles": int(clusters["triangle_count"].max(initial=0)),
                "max_vertices": int(clusters["vertex_count"].max(initial=0)),
            }
        )
    return total_counts(counts, max_triangles)


def total_counts(meshes: Sequence[dict[str, Any]], max_triangles: int) -> dict[str, Any]:
    """The sums of what is known of each mesh, by the names that commands print."""

    def total(name: str) -> int:
        return sum(mesh[name] for mesh in meshes)

    def most(name: str) -> int:
        return max((mesh[name] for mesh in meshes), default=0)

    def is_stuck(mesh: dict[str, Any]) -> bool:
        """By the builder's rule: unless no more than one cluster's worth is left."""
        return bool(mesh["root_clusters"] > 1 and mesh["root_triangles"] > max_triangles)

    room = total("clusters") * max_triangles
    return {
        "levels": most("levels"),
        "groups": total("groups"),
        "clusters": total("clusters"),
        "triangles_all_levels": total("triangles"),
        "root_groups": total("root_groups"),
        "root_triangles": total("root_triangles"),
        "stuck_groups": sum(mesh["root_groups"] for mesh in meshes if is_stuck(mesh)),
        "mean_fill": total("triangles") / room if room else 0.0,
        "max_cluster_triangles": most("max_triangles"),
        "max_cluster_vertices": most("max_vertices"),
    }
