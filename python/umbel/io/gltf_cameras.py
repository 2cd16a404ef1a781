"""Perspective cameras of glTF."""

from __future__ import annotations

import numpy as np

from umbel.camera import Camera
from umbel.io.gltf_buffers import Json
from umbel.mesh import Float64Array


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
    # One part in a thousand of where it stands, so that single precision keeps the direction.
    target = position + forward * max(1.0, 1e-3 * float(np.abs(position).max()))
    return Camera(
        tuple(position.tolist()),
        tuple(target.tolist()),
        fov_y=float(fov_y),
        up=tuple(up.tolist()),
        name=name,
    )
