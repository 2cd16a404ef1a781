"""A thousand instances of one mesh as one asset, and how to render it within 512 MB.

python examples/python/6_thousand_instances.py [MESH [FOLDER]]
"""

import sys
from pathlib import Path

import numpy as np

import umbel

mesh = umbel.load(sys.argv[1]) if len(sys.argv) > 1 else umbel.shapes.blob(5)
folder = Path(sys.argv[2] if len(sys.argv) > 2 else ".")
lod = umbel.build_lod(mesh, precision="16bits")

low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
base, size = (low + high) / 2 * (1, 0, 1) + low * (0, 1, 0), float(np.linalg.norm(high - low))
random = np.random.default_rng(1)
instances = []
for k in range(1000):
    # 25 rows of 40 with jitter, each turned about the vertical axis.
    x, z = np.array([k % 40 - 19.5, -(k // 40)]) * 1.05 + random.uniform(-0.12, 0.12, 2)
    turn, scale = random.uniform(0, 2 * np.pi), random.uniform(0.85, 1.15)
    matrix = np.eye(4)
    cos, sin = scale * np.cos(turn), scale * np.sin(turn)
    matrix[:3, :3] = [[cos, 0, sin], [0, scale, 0], [-sin, 0, cos]]
    matrix[:3, 3] = np.array([x, 0, z]) * size - matrix[:3, :3] @ base
    instances.append((0, matrix))
path = folder / "instances.umbel"
written = umbel.save_asset(path, [lod], instances)
print(f"{1000 * len(mesh.triangles)} triangles in {written} bytes: {path}")

eye, target = np.array([(0, 1.2, 2.5), (0, -0.2, -6)]) * size
print(
    f"umbel render {path} -o instances.png --width 960 --height 540 --pixel-error 1 --budget 512MB "
    f"--camera {','.join(f'{x:.4g}' for x in eye)}:{','.join(f'{x:.4g}' for x in target)}:40"
)
