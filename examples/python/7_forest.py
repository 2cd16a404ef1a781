"""A forest as one file: any number of trees, a tree of instances over them, and what views show.

7_forest.py [TREES [MESH [FILE.umbel]]], by default 100000 of a made-up fir into forest.umbel.
"""

import math
import sys
import time

import numpy as np

import umbel

count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
path = sys.argv[3] if len(sys.argv) > 3 else "forest.umbel"


def fir() -> umbel.Mesh:
    """Twelve whorls of drooping branches."""
    corners, triangles = [], []
    for whorl in range(12):
        height, reach = 1 + whorl, 3 * (1 - whorl / 13)
        for k in range(12):
            a, b = (2 * math.pi * (k + s) / 12 for s in (0.15, 0.85))
            first = len(corners)
            corners += [(0, height + 1.5, 0)]
            corners += [(reach * math.cos(t), height, reach * math.sin(t)) for t in (a, b)]
            triangles.append((first, first + 1, first + 2))
    mesh = umbel.Mesh(np.array(corners, np.float32), np.array(triangles, np.uint32))
    green = umbel.Material(name="needles", base_color=(0.05, 0.15, 0.05, 1), double_sided=True)
    mesh.materials, mesh.material_ids = [green], np.zeros(len(triangles), np.uint32)
    return mesh


if len(sys.argv) > 2:
    mesh = umbel.io.load_scene(sys.argv[2]).flatten()
    mesh.positions = mesh.positions[:, [0, 2, 1]] * np.float32([1, 1, -1])  # z is up in the file
else:
    mesh = fir()
lod = umbel.build_lod(mesh)
low, high = mesh.positions.min(0), mesh.positions.max(0)
spacing = 1.2 * float(max(high[0] - low[0], high[2] - low[2]))

random = np.random.default_rng(1)
side = math.ceil(math.sqrt(count))
angle = random.uniform(0, 2 * math.pi, count)
scale = random.uniform(0.7, 1.3, count)
matrices = np.zeros((count, 3, 4), np.float32)
matrices[:, 0, 0] = matrices[:, 2, 2] = scale * np.cos(angle)
matrices[:, 0, 2] = scale * np.sin(angle)
matrices[:, 2, 0] = -matrices[:, 0, 2]
matrices[:, 1, 1] = scale
places = np.stack([np.arange(count) % side, np.arange(count) // side], 1).astype(np.float32)
matrices[:, ::2, 3] = spacing * (places + random.uniform(-0.4, 0.4, (count, 2)))


def hills(points: np.ndarray) -> np.ndarray:
    """How high the ground is at (n, 3) points."""
    x, z = points[:, 0] / spacing, points[:, 2] / spacing
    return 5 * spacing * (np.sin(x / 37) + np.cos(z / 29))


matrices[:, 1, 3] = hills(matrices[:, :, 3])

# The ground is one more instance, of a mesh of its own.
ground = umbel.shapes.grid(512, 512)
ground.positions = side * spacing * ground.positions[:, [1, 2, 0]]
ground.positions[:, 1] = hills(ground.positions)
ground.material_ids = np.zeros(len(ground.triangles), np.uint32)
ground.materials = [umbel.Material(name="ground", base_color=(0.12, 0.1, 0.06, 1))]
matrices = np.concatenate([matrices, np.eye(4, dtype=np.float32)[None, :3]])
meshes = np.append(np.zeros(count, np.uint32), np.uint32(1))

begun = time.perf_counter()
lods = [lod, umbel.build_lod(ground)]
size = umbel.save_asset(path, lods, umbel.Placements(matrices, meshes))
print(f"{count:,} trees of {len(mesh.triangles):,} triangles: {size / 1e6:.1f} MB", end=" ")
print(f"in {time.perf_counter() - begun:.1f} s")

begun = time.perf_counter()
asset = umbel.Asset(path)
if not asset.has_instance_tree:
    sys.exit("the file lists so few trees; from 65,536 on it has a tree of instances")
selector = umbel.InstanceSelector(asset)
print(f"opened in {1e3 * (time.perf_counter() - begun):.0f} ms")
middle = np.array([side * spacing / 2, 0, side * spacing / 2])
for away in (0.0, 0.5, 2.0, 8.0, 128.0):
    eye = middle + away * side * spacing * np.array([0.2, 0.6, -0.8]) + [0, 8 * spacing, 0]
    target = middle + np.array([0, 0, 100 * spacing])
    camera = umbel.Camera(eye.tolist(), target.tolist())
    step = selector.settle(camera, aspect=16 / 9)
    print(f"from {away:5} sides away: {step.shown:,} instances", end=", ")
    print(
        f"{step.stand_ins:,} of them for others, {step.refined:,} finer than the coarsest", end="; "
    )
    print(f"{selector.bytes / 1e6:.1f} MB in memory")
