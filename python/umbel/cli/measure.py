"""What commands measure besides what the library says: memory, files, tables."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..tables import Tables


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


def sha256_of(path: Path) -> str:
    """The file's SHA-256, in hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def table_counts(tables: Tables, max_triangles: int) -> dict[str, Any]:
    """What the tables of an asset say about it."""
    import numpy as np

    clusters, groups = tables.clusters, tables.groups
    triangles = int(clusters["triangle_count"].sum(dtype=np.int64))
    roots = groups[np.isinf(groups["error"])]
    root_triangles = sum(
        int(clusters["triangle_count"][offset : offset + count].sum(dtype=np.int64))
        for offset, count in zip(
            roots["cluster_offset"].tolist(), roots["cluster_count"].tolist(), strict=True
        )
    )
    # The rule of the builder: roots are stuck unless no more than one cluster's worth is left.
    finished = roots["cluster_count"].sum() <= 1 or root_triangles <= max_triangles
    stuck_groups = 0 if finished else len(roots)
    return {
        "levels": len(tables.levels),
        "groups": len(groups),
        "clusters": len(clusters),
        "triangles_all_levels": triangles,
        "root_groups": len(roots),
        "root_triangles": root_triangles,
        "stuck_groups": stuck_groups,
        "mean_fill": triangles / (len(clusters) * max_triangles) if len(clusters) else 0.0,
        "max_cluster_triangles": int(clusters["triangle_count"].max(initial=0)),
        "max_cluster_vertices": int(clusters["vertex_count"].max(initial=0)),
    }
