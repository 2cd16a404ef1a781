"""Clusters a mesh file or a generated mesh with each preset and prints their quality."""

import sys

import umbel

mesh = umbel.load(sys.argv[1]) if len(sys.argv) > 1 else umbel.shapes.blob(6)
for preset in ("quality", "fast", "exact"):
    clusters = umbel.cluster_mesh(mesh, max_triangles=128, preset=preset)
    metrics = clusters.metrics()
    print(
        f"{preset}: {len(clusters)} clusters, {metrics['mean_fill']:.1%} full, "
        f"surface area ratio {metrics['surface_area_ratio']:.2f}"
    )

first = clusters.items[clusters.offsets[0] : clusters.offsets[1]]
print("the first cluster's triangles:", mesh.triangles[first].shape)
