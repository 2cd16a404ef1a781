"""A viewpoint, as far as level of detail is concerned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from . import _umbel


@dataclass(frozen=True)
class Camera:
    """Asks for detail so that errors stay below `pixel_error` pixels of a picture `height`
    pixels high with the vertical field of view `fov_y` in radians, seen from `position` in the
    mesh's unit. A cut covers the whole mesh, so `target` and `up` do not change it; a picture
    needs the target, and takes the zenith where `up` is None."""

    position: Sequence[float]
    target: Sequence[float] | None = None
    fov_y: float = math.pi / 3
    height: int = 1080
    pixel_error: float = 1.0
    up: Sequence[float] | None = None
    name: str = ""  #: of a camera that a file has

    def view(self) -> _umbel.View:
        x, y, z = (float(value) for value in self.position)
        return _umbel.view_camera((x, y, z), self.fov_y, self.height, self.pixel_error)
