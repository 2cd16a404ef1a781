"""Rendering an asset from its pages, within a budget: the cut that a camera needs, each cluster
with a small tree of its own, however many instances show it."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.camera import Camera
from umbel.geometry.mesh import Mesh
from umbel.geometry.repair import Progress
from umbel.lod.asset import Asset
from umbel.lod.instances import all_instances, asset_boxes, local_transforms
from umbel.lod.residency import Residency
from umbel.trace.renderer import Renderer
from umbel.trace.shading import Environment, Shading, matching

_PAGES = 1 / 6
"""Share of a budget that pages may take, as they are in the file, while the cut is chosen."""
_BYTES_A_TRIANGLE, _BYTES_A_VERTEX, _BYTES_A_CLUSTER, _BYTES_AN_INSTANCE = 110, 12, 160, 60
"""What is traced takes, at most."""
_MOST_UV_SETS = 7
_CAMERA_RAYS, _OTHER_RAYS, _ALL_RAYS = 1, 2, 3


class CutRenderer(Renderer):
    """What a camera needs of an asset, ready to be rendered.

    camera: where from; its `height` and `pixel_error` say how fine.
    budget: most bytes of pages while the cut is chosen, and of what is traced afterwards. Where the
        cut would take more, errors are larger: `pixel_error` says what they became.
    bounce_error: how many times larger the error may be for bounce and shadow rays. They then trace
        a cut of their own, and start beyond the distance that it may have to the camera's.
    hide: as `Renderer` has it, by clusters: where they mix materials, by that of most of their
        triangles.
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
        hide: Sequence[str] = (),
        bounce_error: float = 1.0,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> None:
        if not bounce_error >= 1:
            raise Error(f"bounce_error must be at least 1, not {bounce_error}")
        hidden = matching(asset.materials, hide)
        self.mesh = asset_boxes(asset)
        if not len(self.mesh.triangles):
            raise Error("the asset shows nothing")
        self.up = up
        self._ground, self._threads = False, threads
        self.origin = asset.origin
        if self.origin.any():
            local = (self.mesh.world_positions - self.origin).astype(np.float32)
            self.mesh = replace(self.mesh, positions=local, origin=self.origin)
        camera = camera.relative_to(self.origin)
        transforms = local_transforms(asset)
        meshes = [mesh for mesh, _ in all_instances(asset)]
        self._instances = list(zip(meshes, transforms, strict=True))
        residency = Residency(asset, max(int(budget * _PAGES), 1), groups_per_step=(1 << 32) - 1)
        factors = [1.0] if bounce_error == 1 else [1.0, bounce_error]
        self.pixel_error, self.estimate, tables = _settle(
            residency, self._instances, camera, budget, factors, hidden
        )
        self.page_bytes = residency.statistics["resident_bytes"]
        residency.close()
        count = len(self._instances)
        for k, table in enumerate(tables):
            table[:, 0] += k * count  # the instances of the cut before come first
        kinds = [_ALL_RAYS] if len(tables) == 1 else [_CAMERA_RAYS, _OTHER_RAYS]
        pixel = 2 * math.tan(0.5 * camera.fov_y) / camera.height
        gap = 0.0 if len(tables) == 1 else sum(factors) * self.pixel_error * pixel
        shading = _shading_of(asset)
        self._scene = _umbel.cluster_scene(
            asset._native,
            np.concatenate(tables),
            np.tile(transforms.reshape(-1, 12), (len(tables), 1)),
            np.repeat(np.array(kinds, np.uint32), count),
            gap,
            shading.materials,
            shading.textures,
            (environment or Environment()).native(up),
            progress,
            threads,
        )

    @property
    def triangles(self) -> int:
        """Triangles that are shown, once per instance."""
        return self._scene.instanced_triangles

    @property
    def bytes(self) -> int:
        """Bytes of all that rays touch."""
        return self._scene.bytes


def _shading_of(asset: Asset) -> Shading:
    """The materials of an asset, on a mesh without triangles that has every set of UVs: which of
    them a cluster has, the cluster itself says."""
    return Shading(
        Mesh(
            np.zeros((0, 3), np.float32),
            np.zeros((0, 3), np.uint32),
            uvs=np.zeros((0, 2), np.float32) if asset.info["uvs"] else None,
            uv_sets=[np.zeros((0, 2), np.float32)] * _MOST_UV_SETS,
            material_ids=np.zeros(0, np.uint32),
            materials=asset.materials,
        )
    )


def _settle(
    residency: Residency,
    instances: list[tuple[int, Any]],
    camera: Camera,
    budget: int,
    factors: list[float],
    hidden: list[int],
) -> tuple[float, int, list[Any]]:
    """Loads until the cuts are there, of so many times the error each; the error in pixels that
    fits the budget, about how much what is traced will take, and the cuts' tables."""
    pixels = camera.pixel_error
    while True:
        needs, tables = 0, []
        for factor in factors:
            fits = _load(residency, _views(instances, camera, factor * pixels))
            clusters, triangles, vertices, drawn = residency._native.cost()
            needs += (
                _BYTES_A_TRIANGLE * triangles
                + _BYTES_A_VERTEX * vertices
                + _BYTES_A_CLUSTER * clusters
                + _BYTES_AN_INSTANCE * drawn
            )
            tables.append(residency._native.table(hidden))
            if not fits or needs > budget:
                break
        else:
            return pixels, needs, tables
        if pixels > 1e6 * camera.pixel_error:
            raise Error(f"even the coarsest cut takes {needs} bytes, more than the budget")
        pixels *= max(1.1, math.sqrt(needs / budget))


def _load(residency: Residency, views: list[tuple[int, _umbel.View, None]]) -> bool:
    """Steps until all that the views want is there, or no more of it will come: whether it is."""
    while True:
        step = residency._native.step(views, time.monotonic())
        if not step["missing_groups"]:
            return True
        said = residency.statistics
        if said["given_up"]:
            raise Error(f"pages cannot be read: {said['last_problem']}")
        if not (said["in_flight"] or step["loaded"] or step["requested"]):
            return False
        time.sleep(0.001)


def _views(
    instances: list[tuple[int, Any]], camera: Camera, pixels: float
) -> list[tuple[int, _umbel.View, None]]:
    eye = tuple(float(x) for x in camera.position)
    view = _umbel.view_camera(eye, camera.fov_y, camera.height, pixels)
    rows = np.array([matrix for _, matrix in instances], np.float32).reshape(-1, 1, 12)
    return [
        (mesh, _umbel.view_in_instance(view, row), None)
        for (mesh, _), row in zip(instances, rows, strict=True)
    ]
