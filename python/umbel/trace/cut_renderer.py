"""Rendering an asset from its pages, within a budget: the cut that a camera needs, each cluster
with a small tree of its own, however many instances show it."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.camera import Camera
from umbel.geometry.mesh import Mesh
from umbel.geometry.repair import Progress
from umbel.lod.asset import Asset
from umbel.lod.instances import (
    ShownInstances,
    asset_boxes,
    listed_instances,
    shown_instances,
)
from umbel.lod.residency import Residency
from umbel.trace.renderer import Renderer
from umbel.trace.shading import Environment, Shading, matching, uv_set_of

_PAGES = 6
"""One of so many parts of a budget may go to pages, as they are in the file, while the cut is
chosen."""
_BYTES_A_TRIANGLE, _BYTES_A_VERTEX, _BYTES_A_CLUSTER, _BYTES_AN_INSTANCE = 110, 12, 160, 60
"""What is traced takes, at most."""
_ATTEMPTS, _BACKOFF = 5, 0.1
"""To read a page; seconds before the second, twice that before the third, and so on."""
_CAMERA_RAYS, _OTHER_RAYS, _ALL_RAYS = 1, 2, 3


class CutRenderer(Renderer):
    """What a camera needs of an asset, ready to be rendered.

    camera: where from; its `height` and `pixel_error` say how fine.
    budget: most bytes of pages while the cut is chosen, and of what is traced afterwards. Where the
        cut would take more, errors are larger: `pixel_error` says what they became.
    bounce_error: how many times larger the error may be for bounce and shadow rays. They then trace
        a cut of their own, and start beyond the distance that it may have to the camera's.
    aspect: width / height of the picture. What is outside of it is then left out of the camera's
        cut of a tree of instances, if other rays trace a cut of their own.
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
        aspect: float | None = None,
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
        residency = _resident(asset, budget)
        factors = [1.0] if bounce_error == 1 else [1.0, bounce_error]
        planes = _wide_frustum(camera, aspect) if aspect and len(factors) > 1 else None
        self.pixel_error, self.estimate, cuts = _settle(
            residency, _Instances(asset, camera, planes), budget, factors, hidden
        )
        self.page_bytes = residency.statistics["resident_bytes"]
        residency.close()
        first = 0
        for cut in cuts:
            cut.table[:, 0] += first  # the instances of the cut before come first
            first += len(cut.transforms)
        kinds = [_ALL_RAYS] if len(cuts) == 1 else [_CAMERA_RAYS, _OTHER_RAYS]
        pixel = 2 * math.tan(0.5 * camera.fov_y) / camera.height
        gap = 0.0 if len(cuts) == 1 else sum(factors) * self.pixel_error * pixel
        shading = _shading_of(asset)
        self._scene = _umbel.cluster_scene(
            asset._native,
            np.concatenate([cut.table for cut in cuts]),
            np.concatenate([cut.transforms.reshape(-1, 12) for cut in cuts]),
            np.repeat(np.array(kinds, np.uint32), [len(cut.transforms) for cut in cuts]),
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


def _resident(asset: Asset, budget: int) -> Residency:
    """The pages, in their part of the budget."""
    try:
        return Residency(
            asset,
            max(budget // _PAGES, 1),
            groups_per_step=(1 << 32) - 1,
            attempts=_ATTEMPTS,
            backoff=_BACKOFF,
        )
    except Error as error:
        pages = re.search(r"pages of the root groups take (\d+)", str(error))
        if pages is None:
            raise
        least = _PAGES * int(pages[1])
        raise Error(f"budget is {budget}, but the coarsest pages need at least {least}") from None


def _shading_of(asset: Asset) -> Shading:
    """The materials of an asset, on a mesh without triangles that has the sets of UVs that any of
    its meshes has: which of them a cluster has, the cluster itself says."""
    sets = [np.zeros((0, 2), np.float32)] * _uv_sets(asset)
    return Shading(
        Mesh(
            np.zeros((0, 3), np.float32),
            np.zeros((0, 3), np.uint32),
            uvs=sets[0] if sets else None,
            uv_sets=sets[1:],
            material_ids=np.zeros(0, np.uint32),
            materials=asset.materials,
        )
    )


def _uv_sets(asset: Asset) -> int:
    """How many sets of UVs meshes have; no more is read than materials need."""
    needed = max(
        (1 + uv_set_of(material, slot) for material in asset.materials for slot in material.images),
        default=0,
    )
    found = 0
    for index, mesh in enumerate(asset.meshes):
        if found >= needed:
            break
        if mesh["clusters"] and mesh["uvs"]:
            found = max(found, 1 + len(asset.cluster(0, index).uv_sets))
    return found


@dataclass(frozen=True)
class _Cut:
    """What is traced for some kinds of rays."""

    table: NDArray[np.uint32]
    """(c, 4): an instance's cluster: the instance, and the page, group and cluster."""
    transforms: NDArray[Any]


class _Instances:
    """The instances that a camera sees: all that are listed, or some of a tree of them."""

    def __init__(self, asset: Asset, camera: Camera, planes: NDArray[np.float32] | None) -> None:
        self._asset, self._camera, self._planes = asset, camera, planes
        self._selector = None
        if asset.has_instance_tree:
            self._selector = _umbel.InstanceSelector(asset._native, 1 << 30)

    def seen(self, pixels: float, is_camera: bool) -> ShownInstances:
        """With so large errors, by the camera's rays or by others."""
        view = replace(self._camera, pixel_error=pixels).view()
        if self._selector is None:
            return listed_instances(self._asset, view)
        planes = self._planes if is_camera else None
        return shown_instances(self._asset, self._selector, view, planes)


def _wide_frustum(camera: Camera, aspect: float) -> NDArray[np.float32]:
    """A little more than the picture, whose filter reaches beyond it."""
    wide = replace(camera, fov_y=min(1.05 * camera.fov_y, 0.99 * math.pi))
    return wide.planes(1.02 * aspect).astype(np.float32)


def _settle(
    residency: Residency,
    instances: _Instances,
    budget: int,
    factors: list[float],
    hidden: list[int],
) -> tuple[float, int, list[_Cut]]:
    """Loads until the cuts are there, of so many times the error each; the error in pixels that
    fits the budget, about how much what is traced will take, and the cuts."""
    asked = pixels = instances._camera.pixel_error
    while True:
        needs, cuts = 0, []
        for k, factor in enumerate(factors):
            seen = instances.seen(factor * pixels, k == 0 and len(factors) > 1)
            fits = _load(residency, [(m, v, None) for m, v in _pairs(seen)])
            clusters, triangles, vertices, _ = residency._native.cost()
            table = _spread(residency._native.table(hidden), seen.view_of)
            needs += (
                _BYTES_A_TRIANGLE * triangles
                + _BYTES_A_VERTEX * vertices
                + _BYTES_A_CLUSTER * clusters
                + _BYTES_AN_INSTANCE * len(table)
            )
            cuts.append(_Cut(table, seen.transforms))
            if not fits or needs > budget:
                break
        else:
            return pixels, needs, cuts
        if pixels > 1e6 * asked:
            raise Error(f"even the coarsest cut takes {needs} bytes, more than the budget")
        pixels *= max(1.1, math.sqrt(needs / budget))


def _pairs(seen: ShownInstances) -> Iterable[tuple[int, _umbel.View]]:
    return zip(seen.view_meshes, seen.views, strict=True)


def _spread(table: NDArray[np.uint32], view_of: NDArray[np.int64]) -> NDArray[np.uint32]:
    """A table of views' clusters as one of instances'; several instances may share a view."""
    views = table[:, 0].astype(np.int64)
    table = table[np.argsort(views, kind="stable")]
    counts = np.bincount(views, minlength=int(view_of.max(initial=-1)) + 1)
    begins = np.concatenate([[0], np.cumsum(counts)[:-1]])
    each = counts[view_of]
    first = np.cumsum(each) - each
    rows = np.arange(int(each.sum())) + np.repeat(begins[view_of] - first, each)
    spread: NDArray[np.uint32] = table[rows]
    spread[:, 0] = np.repeat(np.arange(len(view_of), dtype=np.uint32), each)
    return spread


def _load(residency: Residency, views: list[tuple[int, _umbel.View, None]]) -> bool:
    """Steps until all that the views want is there, or no more of it will come: whether it is."""
    active = time.monotonic()
    while True:
        now = time.monotonic()
        step = residency._native.step(views, now)
        if not step["missing_groups"]:
            return True
        said = residency.statistics
        if said["given_up"]:
            raise Error(f"pages cannot be read: {said['last_problem']}")
        if said["in_flight"] or step["loaded"] or step["requested"]:
            active = now
        elif not said["failures"] or now > active + _BACKOFF * 2**_ATTEMPTS:
            return False  # else pages that failed may be due again
        time.sleep(0.001)
