"""What a view shows of millions of instances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import whole
from umbel.geometry.camera import Camera
from umbel.lod.tables import check_error

if TYPE_CHECKING:
    from umbel.lod.asset import Asset


@dataclass(frozen=True)
class InstanceStep:
    """What a view shows of a tree of instances."""

    runs: NDArray[np.uint32]
    """(r, 4): a node, or 2**32 - 1 for `Asset.instances`; the first placement in its page; how
    many; and whether the coarsest clusters of their meshes are fine enough."""
    missing: NDArray[np.uint32]
    """Nodes whose pages are wanted, the most urgent first."""
    shown: int
    """Placements in all runs."""
    refined: int
    """Of these, those that need more than the coarsest clusters."""
    stand_ins: int
    """Of these, those that stand for others."""


class InstanceSelector:
    """Selects from an asset's tree of instances, and keeps the pages of it that were read.

    max_bytes: about how many bytes of pages that the last step did not show are kept; 0: all.
    """

    def __init__(self, asset: Asset, max_bytes: int = 64 << 20) -> None:
        self.asset = asset
        self._native = _umbel.InstanceSelector(
            asset._native, whole("max_bytes", max_bytes, 2**64 - 1)
        )

    def step(
        self,
        camera: Camera | None = None,
        *,
        error: float | None = None,
        aspect: float | None = None,
    ) -> InstanceStep:
        """What is shown of what was read, by camera or by error in the scene's unit. With `aspect`,
        width / height of the camera's picture, without what lies outside of it. Reads nothing."""
        return InstanceStep(*self._native.step(*self._view(camera, error, aspect)))

    def settle(
        self,
        camera: Camera | None = None,
        *,
        error: float | None = None,
        aspect: float | None = None,
    ) -> InstanceStep:
        """The same after all that the view needs was read."""
        return InstanceStep(*self._native.settle(*self._view(camera, error, aspect)))

    def load(self, nodes: NDArray[np.uint32], most: int = 1 << 62) -> None:
        """Reads pages: those of a step's `missing`."""
        self._native.load(np.ascontiguousarray(nodes, np.uint32), most)

    def placements(self, step: InstanceStep) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """What a step shows: (n,) meshes; (n, 3, 4) transforms, relative to the asset's origin; and
        whether the coarsest clusters are fine enough, (n,)."""
        meshes, rows = self._native.placements(step.runs)
        coarsest = np.repeat(step.runs[:, 3] != 0, step.runs[:, 2])
        return meshes, rows.reshape(-1, 3, 4), coarsest

    @property
    def bytes(self) -> int:
        """Of pages that are kept."""
        return int(self._native.bytes)

    def _view(
        self, camera: Camera | None, error: float | None, aspect: float | None
    ) -> tuple[_umbel.View, NDArray[np.float32] | None]:
        if (camera is None) == (error is None):
            raise Error("a step needs either a camera or an error")
        if camera is None:
            assert error is not None
            check_error(error)
            return _umbel.view_error(error), None
        local = camera.relative_to(self.asset.origin)
        planes = None if aspect is None else local.planes(aspect).astype(np.float32)
        return local.view(), planes
