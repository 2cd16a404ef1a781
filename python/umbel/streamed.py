"""Rendering an asset from its pages, within a budget: the cut that a camera needs, each cluster
with a small tree of its own, however many instances show it."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from . import _umbel
from .asset import Asset
from .camera import Camera
from .errors import Error
from .look import Environment, Look
from .mesh import Mesh
from .repair import Progress
from .stream import Residency
from .trace import Renderer

_PAGES = 1 / 6
"""Share of a budget that pages may take, as they are in the file, while the cut is chosen."""
_BYTES_A_TRIANGLE, _BYTES_A_VERTEX, _BYTES_A_CLUSTER, _BYTES_A_PLACE = 110, 12, 160, 60
"""What is traced takes, at most."""
_BOX = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
_BOX += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]


class CutRenderer(Renderer):
    """What a camera needs of an asset, ready to be rendered.

    camera: where from; its `height` and `pixel_error` say how fine.
    budget: most bytes of pages while the cut is chosen, and of what is traced afterwards. Where the
        cut would take more, errors are larger: `pixel_error` says what they became.
    The rest is as `Renderer` has it.
    """

    def __init__(
        self,
        asset: Asset,
        camera: Camera,
        budget: int,
        *,
        environment: Environment | None = None,
        up: str = "y",
        progress: Progress | None = None,
        threads: int = 0,
    ) -> None:
        self.mesh = boxes(asset)
        self.up = up
        self._ground, self._threads = False, threads
        self._places = places(asset)
        residency = Residency(asset, max(int(budget * _PAGES), 1))
        self.pixel_error, self.estimate = _settle(residency, self._places, camera, budget)
        self.page_bytes = residency.statistics["resident_bytes"]
        table = residency._native.table()
        residency.close()
        look = Look(
            Mesh(
                np.zeros((0, 3), np.float32),
                np.zeros((0, 3), np.uint32),
                uvs=np.zeros((0, 2), np.float32) if asset.info["uvs"] else None,
                material_ids=np.zeros(0, np.uint32),
                materials=asset.materials,
            )
        )
        transforms = np.array([matrix for _, matrix in self._places], np.float32)
        self._scene = _umbel.cluster_scene(
            asset._native,
            table,
            transforms.reshape(-1, 12),
            look.materials,
            look.textures,
            (environment or Environment()).native(up),
            progress,
            threads,
        )

    @property
    def triangles(self) -> int:
        """Triangles that are shown, each as often as it stands somewhere."""
        return self._scene.placed_triangles

    @property
    def bytes(self) -> int:
        """Bytes of all that rays touch."""
        return self._scene.bytes


def places(asset: Asset) -> list[tuple[int, Any]]:
    """Mesh and (3, 4) matrix of everything that the asset shows."""
    if asset.instances:
        return asset.instances
    return [(mesh, np.eye(4, dtype=np.float32)[:3]) for mesh in range(len(asset.meshes))]


def boxes(asset: Asset) -> Mesh:
    """The boxes of all that the asset shows, to aim cameras at."""
    corners, count = [], 0
    for mesh, matrix in places(asset):
        bounds = asset.meshes[mesh]["bounds"]
        if bounds is None:
            continue
        low, high = np.array(bounds, np.float64)
        unit = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)])
        corners.append((low + unit * (high - low)) @ matrix[:, :3].T + matrix[:, 3])
        count += 1
    if not count:
        raise Error("the asset shows nothing")
    faces = np.concatenate([np.array(_BOX, np.uint32) + 8 * k for k in range(count)])
    return Mesh(np.concatenate(corners).astype(np.float32), faces)


def _settle(
    residency: Residency, standing: list[tuple[int, Any]], camera: Camera, budget: int
) -> tuple[float, int]:
    """Loads until the cut is there; the error in pixels that fits the budget, and about how much
    what is traced will take."""
    pixels = camera.pixel_error
    while True:
        views = _views(standing, camera, pixels)
        while True:
            step = residency._native.step(views, time.monotonic())
            if not step["missing_groups"]:
                break
            said = residency.statistics
            if said["given_up"]:
                raise Error(f"pages cannot be read: {said['last_problem']}")
            if not (said["in_flight"] or step["loaded"] or step["requested"]):
                break
            time.sleep(0.001)
        clusters, triangles, vertices, placed = residency._native.cost()
        needs = (
            _BYTES_A_TRIANGLE * triangles
            + _BYTES_A_VERTEX * vertices
            + _BYTES_A_CLUSTER * clusters
            + _BYTES_A_PLACE * placed
        )
        if not step["missing_groups"] and needs <= budget:
            return pixels, needs
        if pixels > 1e6 * camera.pixel_error:
            raise Error(f"even the coarsest cut takes {needs} bytes, more than the budget")
        pixels *= max(1.1, math.sqrt(needs / budget))


def _views(
    standing: list[tuple[int, Any]], camera: Camera, pixels: float
) -> list[tuple[int, _umbel.View, None]]:
    eye = tuple(float(x) for x in camera.position)
    view = _umbel.view_camera(eye, camera.fov_y, camera.height, pixels)
    rows = np.array([matrix for _, matrix in standing], np.float32).reshape(-1, 1, 12)
    return [
        (mesh, _umbel.view_in_instance(view, row), None)
        for (mesh, _), row in zip(standing, rows, strict=True)
    ]
