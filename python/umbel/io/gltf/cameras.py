"""Perspective cameras of glTF."""

from __future__ import annotations

import numpy as np

from umbel.geometry.camera import Camera
from umbel.geometry.mesh import Float64Array
from umbel.io.gltf.buffers import Json
from umbel.io.gltf.tree import worlds


def tree_cameras(tree: Json) -> list[Camera]:
    """The perspective cameras of a scene's tree."""
    nodes, cameras = tree.get("nodes", []), tree.get("cameras", [])
    with_one = [k for k, node in enumerate(nodes) if "camera" in node]
    every = worlds(nodes) if with_one else []
    found = []
    for k in with_one:
        number = nodes[k]["camera"]
        if isinstance(number, int) and 0 <= number < len(cameras):
            name = str(nodes[k].get("name") or cameras[number].get("name") or "")
            found.append(read_camera(cameras[number], name, every[k]))
    return [camera for camera in found if camera is not None]


def read_camera(entry: Json, name: str, world: Float64Array) -> Camera | None:
    """The camera of a node whose matrix to the world is `world`: it looks along its -Z, with its
    +Y up. None where it is orthographic or looks nowhere."""
    fov_y = (entry.get("perspective") or {}).get("yfov", 0.0)
    with np.errstate(all="ignore"):
        forward, up = -world[:3, 2], world[:3, 1]
        forward = forward / np.linalg.norm(forward)
        up = up / np.linalg.norm(up)
    position = world[:3, 3]
    if not (np.isfinite([*position, *forward, *up]).all() and 0.0 < fov_y < np.pi):
        return None
    # One part in a thousand of its distance, so that single precision keeps the direction.
    target = position + forward * max(1.0, 1e-3 * float(np.abs(position).max()))
    return Camera(
        tuple(position.tolist()),
        tuple(target.tolist()),
        fov_y=float(fov_y),
        up=tuple(up.tolist()),
        name=name,
    )
