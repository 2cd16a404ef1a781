"""Rays, distances, refit and files of a BVH, and Umbel as the ray engine of a trimesh mesh."""

import sys

import numpy as np
import trimesh

import umbel

mesh = umbel.load(sys.argv[1]) if len(sys.argv) > 1 else umbel.shapes.blob(6)
bvh = umbel.Bvh(mesh, builder="quality", width=8)
print(bvh, f"SAH cost {bvh.sah_cost:.1f}")

low, high = bvh.bounds
middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
rng = np.random.default_rng(1)
directions = rng.normal(size=(100_000, 3)).astype(np.float32)
origins = middle - size * directions / np.linalg.norm(directions, axis=1, keepdims=True)

hits = bvh.intersect(origins, directions)
points = origins[hits.hit] + hits.t[hits.hit, None] * directions[hits.hit]
print(f"{hits.hit.mean():.0%} of the rays hit; the first at {points[0]}")
print(f"a ray hits {bvh.all_hits(origins[:1000], directions[:1000]).counts.mean():.1f} triangles")
print(f"{bvh.occluded(origins, directions, t_max=1.5).mean():.0%} are blocked before t = 1.5")

samples = rng.uniform(low, high, (1000, 3))
closest = bvh.closest_point(samples)
print(f"{bvh.contains(samples).mean():.0%} of the box is inside; farthest from the surface:")
print(f"  {samples[closest.distance.argmax()]}, {closest.distance.max():.3f} away")
print(len(bvh.overlaps_sphere(points[0], 0.05 * size)), "triangles are near the first hit")

report = bvh.refit(mesh.positions * np.float32(1.1))
print(f"after the refit: SAH cost {report.sah_cost:.1f}, rebuild: {report.rebuild_advised}")
bvh.save("mesh.umbvh")
assert umbel.Bvh.load("mesh.umbvh").statistics() == bvh.statistics()

ball = trimesh.creation.icosphere(subdivisions=4)
ball.ray = umbel.trimesh_rays(ball)
locations, index_ray, index_tri = ball.ray.intersects_location(
    ray_origins=[[0, 0, -5], [2, 2, -10]], ray_directions=[[0, 0, 1], [0, 0, 1]]
)
print("trimesh:", locations.tolist(), "of triangles", index_tri.tolist())
