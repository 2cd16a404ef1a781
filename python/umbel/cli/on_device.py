"""What commands do with `--device cuda`: arrays go to the device and come back."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from umbel.cluster.clusters import Clusters
    from umbel.geometry.mesh import Mesh


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
