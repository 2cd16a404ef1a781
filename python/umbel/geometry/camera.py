"""A camera for selection and pictures, and the projected size of errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import number, whole
from umbel.geometry.origin import is_far


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

    def relative_to(self, origin: ArrayLike) -> Camera:
        """The same camera where `origin` is zero: subtracted in double precision."""
        shift = np.asarray(origin, np.float64)
        if not shift.any():
            return self
        position = tuple((np.array(_triple(self.position)) - shift).tolist())
        target = self.target
        if target is not None:
            target = tuple((np.array(_triple(target)) - shift).tolist())
        return replace(self, position=position, target=target)

    def view(self) -> _umbel.View:
        return _umbel.view_camera(
            _triple(self.position),
            number("a camera's fov_y", self.fov_y),
            whole("a camera's height", self.height),
            number("a camera's pixel_error", self.pixel_error),
        )

    def planes(
        self, aspect: float = 1.0, *, near: float = 0.0, far: float = math.inf
    ) -> NDArray[Any]:
        """(5, 4), or (6, 4) with a finite `far`: the frustum of a picture `aspect` times as wide
        as high, as inward unit normals n and offsets d; a point p is inside where n . p + d >= 0.
        Left, right, bottom, top, near, far. In float64 where the camera is far from zero, beside
        how far it looks, else in float32."""
        if self.target is None:
            raise Error("a frustum needs the camera's target")
        if is_far(np.array([_triple(self.position), _triple(self.target)])):
            near_zero = self.relative_to(self.position)
            return moved_planes(near_zero.planes(aspect, near=near, far=far), self.position)
        eye, target = _triple(self.position), _triple(self.target)
        up = (0.0, 1.0, 0.0) if self.up is None else _triple(self.up)
        if self.up is None and eye[0] == target[0] and eye[2] == target[2]:
            up = (0.0, 0.0, 1.0)
        return _umbel.frustum_planes(eye, target, up, self.fov_y, aspect, near, far)


def moved_planes(planes: ArrayLike, by: ArrayLike) -> NDArray[np.float64]:
    """(p, 4) planes of things that are moved by a vector, in float64."""
    moved = np.array(planes, np.float64)
    moved[:, 3] -= moved[:, :3] @ np.asarray(by, np.float64)
    return moved


def _triple(values: Sequence[float]) -> tuple[float, float, float]:
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError):
        raise Error(
            f"a camera's position, target and up must be three numbers, not {values!r}"
        ) from None
    return x, y, z


def angular_error(error: float, distance: float) -> float:
    """The angle in radians under which `error` is seen from `distance`, in the same unit:
    asin(error / distance), and pi / 2 from where the distance is not larger."""
    return _umbel.angular_error(error, distance)


def pixel_error(error: float, distance: float, fov_y: float, height: int) -> float:
    """The same in pixels of a picture `height` pixels high with the vertical field of view `fov_y`
    in radians: error / distance * height / (2 tan(fov_y / 2))."""
    return _umbel.pixel_error(error, distance, fov_y, height)
