"""What commands measure besides what the library says: memory, files, tables."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from umbel.lod.tables import Tables


_LARGEST = {
    "max_cluster_triangles": "triangle_count",
    "max_cluster_vertices": "vertex_count",
}


def peak_rss_bytes() -> int:
    """The most memory that this process has had resident."""
    # Linux counts what a process had before exec() in ru_maxrss, but not in VmHWM.
    status = Path("/proc/self/status")
    if status.is_file():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    import resource
    import sys

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def sha256_of(path: str | Path) -> str:
    """The file's SHA-256, in hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def table_counts(meshes: Sequence[Tables], max_triangles: int) -> dict[str, Any]:
    """What the tables of an asset's meshes say about it."""
    import numpy as np

    counts = {"levels": 0, "groups": 0, "clusters": 0, "triangles_all_levels": 0}
    counts |= {"root_groups": 0, "root_triangles": 0, "stuck_groups": 0}
    largest = dict.fromkeys(_LARGEST, 0)
    for tables in meshes:
        clusters, groups = tables.clusters, tables.groups
        roots = groups[np.isinf(groups["error"])]
        root_triangles = sum(
            int(clusters["triangle_count"][offset : offset + count].sum(dtype=np.int64))
            for offset, count in zip(
                roots["cluster_offset"].tolist(), roots["cluster_count"].tolist(), strict=True
            )
        )
        # The rule of the builder: roots are stuck unless no more than one cluster's worth is left.
        finished = roots["cluster_count"].sum() <= 1 or root_triangles <= max_triangles
        counts["levels"] = max(counts["levels"], len(tables.levels))
        counts["groups"] += len(groups)
        counts["clusters"] += len(clusters)
        counts["triangles_all_levels"] += int(clusters["triangle_count"].sum(dtype=np.int64))
        counts["root_groups"] += len(roots)
        counts["root_triangles"] += root_triangles
        counts["stuck_groups"] += 0 if finished else len(roots)
        for key, column in _LARGEST.items():
            largest[key] = max(largest[key], int(clusters[column].max(initial=0)))
    room = counts["clusters"] * max_triangles
    fill = counts["triangles_all_levels"] / room if room else 0.0
    return {**counts, "mean_fill": fill, **largest}
