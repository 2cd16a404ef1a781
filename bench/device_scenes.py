"""The scenes of `scripts/gpu.sh paths`, packed for a machine without a network and unpacked there.

A scene is a mesh, the three cameras that `umbel bench bvh` finds, and parameters of k-means. The
plant is generated where it is traced, from its three shapes. Packing needs umbel; unpacking needs
NumPy alone.

    python bench/device_scenes.py FOLDER [--plant TRIANGLES] MESH...
"""

from __future__ import annotations

import argparse
import json
import lzma
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = tuple[NDArray[np.float32], NDArray[np.uint32]]
"""(v, 3) positions and (t, 3) triangles."""

MANIFEST = "scenes.json"
PLANT_TRIANGLES = 12_760_000


def packed(positions: NDArray[np.float32], triangles: NDArray[np.uint32]) -> bytes:
    """A mesh in few bytes: every bit of the positions, and the order of the triangles. Vertices are
    numbered by their first use."""
    corners = triangles.ravel()
    used, first = np.unique(corners, return_index=True)
    order = np.argsort(first, kind="stable")
    new = np.zeros(len(positions), np.uint32)
    new[used[order]] = np.arange(len(used), dtype=np.uint32)
    # How far back a corner's vertex was new: 0 for one that is.
    is_new = np.zeros(len(corners), np.bool_)
    is_new[first] = True
    back = (np.cumsum(is_new) - is_new).astype(np.uint32) - new[corners]
    bits = np.ascontiguousarray(positions[used[order]], np.float32).view(np.uint32)
    steps = np.diff(bits, axis=0, prepend=np.zeros((1, 3), np.uint32))
    sizes = np.array([len(used), len(triangles)], "<u4").tobytes()
    return lzma.compress(
        sizes + _planes(steps.T) + _planes(back.reshape(-1, 3).T),
        format=lzma.FORMAT_XZ,
        preset=6,
    )


def unpacked(data: bytes) -> Arrays:
    """The mesh."""
    content = lzma.decompress(data)
    vertices, triangles = (int(size) for size in np.frombuffer(content, "<u4", 2))
    middle = 8 + 12 * vertices
    steps = _of_planes(content[8:middle], vertices)
    bits = np.cumsum(steps, axis=0, dtype=np.uint32)
    back = _of_planes(content[middle : middle + 12 * triangles], triangles).ravel()
    is_new = back == 0
    corners = (np.cumsum(is_new) - is_new).astype(np.uint32) - back
    return np.ascontiguousarray(bits).view(np.float32), corners.reshape(-1, 3)


def _planes(columns: NDArray[np.uint32]) -> bytes:
    """The lowest bytes of all numbers, then the next ones, column by column."""
    words = np.ascontiguousarray(columns, "<u4")
    return words.view(np.uint8).reshape(3, -1, 4).transpose(0, 2, 1).tobytes()


def _of_planes(data: bytes, count: int) -> NDArray[np.uint32]:
    planes = np.frombuffer(data, np.uint8).reshape(3, 4, count)
    words = np.ascontiguousarray(planes.transpose(0, 2, 1)).view("<u4")
    found: NDArray[np.uint32] = np.ascontiguousarray(words.reshape(3, count).T).astype(np.uint32)
    return found


def write_ply(path: Path, mesh: Arrays) -> None:
    """As binary PLY."""
    positions, triangles = mesh
    faces = np.empty(len(triangles), np.dtype([("count", "u1"), ("corners", "<u4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with path.open("wb") as file:
        file.write(head.encode())
        file.write(np.ascontiguousarray(positions, "<f4").tobytes())
        file.write(faces.tobytes())


def scenes(folder: Path) -> dict[str, dict[str, Any]]:
    """What has been packed, smallest first."""
    found: dict[str, dict[str, Any]] = json.loads((folder / MANIFEST).read_text())
    return found


def unpack(folder: Path, name: str, ply: Path) -> None:
    """Writes the mesh of a scene."""
    scene = scenes(folder)[name]
    if "plant" in scene:
        from umbel.bench.bvh.plant import Arrays, Shapes, plant_arrays

        parts = (unpacked((folder / f"{name}.{part}").read_bytes()) for part in Shapes._fields)
        shapes = Shapes(*(Arrays(*part) for part in parts))
        write_ply(ply, plant_arrays(scene["plant"], shapes))
    else:
        write_ply(ply, unpacked((folder / f"{name}.mesh").read_bytes()))


def pack(folder: Path, meshes: list[Path], plant_triangles: int) -> None:
    """Packs these meshes and the plant."""
    from umbel.bench.bvh import scenes as bvh_scenes
    from umbel.bench.bvh.plant import plant, plant_shapes
    from umbel.io import load

    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, dict[str, Any]] = {}
    for path in meshes:
        mesh = load(path)
        (folder / f"{path.stem}.mesh").write_bytes(packed(mesh.positions, mesh.triangles))
        found[path.stem] = {"triangles": len(mesh.triangles)} | _seen(
            bvh_scenes.scene(path.stem, lambda mesh=mesh: mesh)
        )
    if plant_triangles:
        name = bvh_scenes.GENERATED
        for part, arrays in plant_shapes(plant_triangles)._asdict().items():
            (folder / f"{name}.{part}").write_bytes(packed(*arrays))
        # Its cameras are known, so a small one has them too.
        seen = _seen(bvh_scenes.scene(name, lambda: plant(20_000)))
        found[name] = {"triangles": plant_triangles, "plant": plant_triangles} | seen
    found = dict(sorted(found.items(), key=lambda item: item[1]["triangles"]))
    (folder / MANIFEST).write_text(json.dumps(found, indent=1) + "\n")


def _seen(scene: Any) -> Mapping[str, Any]:
    kmeans = scene.kmeans
    return {
        "kmeans": [kmeans.clusters, kmeans.candidates, kmeans.iterations],
        "cameras": [
            [*camera.position, *camera.target, *camera.up, camera.fov_y] for camera in scene.cameras
        ],
    }


def main() -> None:
    """See the top."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("meshes", type=Path, nargs="*")
    parser.add_argument("--plant", type=int, default=PLANT_TRIANGLES)
    given = parser.parse_intermixed_args()
    pack(given.folder, given.meshes, given.plant)
    size = sum(file.stat().st_size for file in given.folder.iterdir())
    print(f"{given.folder}: {size / 2**20:.1f} MiB", file=sys.stderr)


if __name__ == "__main__":
    main()
