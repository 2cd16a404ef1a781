"""A mesh that deforms, its clusters, a hierarchy over them, and rays, as one CUDA graph: the host
neither waits nor looks at anything in between. Needs a GPU, CuPy and the library of docs/cuda.md.

python examples/cuda/frames.py [MESH [FRAMES]]
"""

import sys

import cupy
import numpy as np

import umbel
from umbel import cuda

mesh = umbel.load(sys.argv[1]) if len(sys.argv) > 1 else umbel.shapes.blob(7)
frames = int(sys.argv[2]) if len(sys.argv) > 2 else 100

rest = cupy.asarray(mesh.positions)
positions = cupy.empty_like(rest)
time = cupy.zeros(1, np.float32)
x, y, z = rest.T

# Rays from in front of the mesh, one for each pixel.
low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
size = float(np.linalg.norm(high - low))
u, v = np.meshgrid(np.linspace(-0.4, 0.4, 1920), np.linspace(-0.25, 0.25, 1080))
directions = cupy.asarray(np.stack([u, v, -np.ones_like(u)], -1).reshape(-1, 3), np.float32)
eye = ((low + high) / 2 + [0, 0, 1.5 * size]).astype(np.float32)
origins = cupy.broadcast_to(cupy.asarray(eye), directions.shape).copy()

stream = cupy.cuda.Stream(non_blocking=True)
with stream:
    positions[:] = rest
    clusters = cuda.FrameClusters(positions, cupy.asarray(mesh.triangles))
    bvh = clusters.bvh(positions)


def frame():
    """All of a frame; `time` is advanced on the device as well."""
    time[:] += np.float32(0.02)
    angle = time[0] * x / size
    cos, sin = cupy.cos(angle), cupy.sin(angle)
    positions[:, 0] = x
    positions[:, 1] = y * cos - z * sin
    positions[:, 2] = y * sin + z * cos
    clusters.build(positions)
    bvh.build(positions)
    return bvh.intersect(origins, directions)


with stream:
    frame()  # makes the scratch memory
    stream.synchronize()
    stream.begin_capture()
    hits = frame()
    graph = stream.end_capture()
    began, ended = cupy.cuda.Event(), cupy.cuda.Event()
    began.record()
    for _ in range(frames):
        graph.launch()
    ended.record()
    ended.synchronize()

took = cupy.cuda.get_elapsed_time(began, ended) / frames
seen = int((hits["primitive"] >= 0).sum())
print(f"{len(mesh.triangles)} triangles, {len(directions)} rays, {seen} hits")
print(f"{took:.3f} ms a frame")
