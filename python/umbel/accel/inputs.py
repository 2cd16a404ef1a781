"""What structures are built over: the triangles of a mesh, or boxes."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import array_of, as_mesh, native, numbers, rows
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import localize


def mesh_from(positions: Any, triangles: ArrayLike | None) -> Mesh:
    """The mesh of positions and triangles, or of whatever `as_mesh` takes alone."""
    if triangles is None:
        return as_mesh(positions)
    points = array_of("positions", positions)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        return Mesh(points, triangles)  # type: ignore[arg-type]
    origin, local = localize(points)  # what rounding loses is no matter of a hierarchy
    return Mesh(local, triangles, origin=origin)  # type: ignore[arg-type]


def geometry_of(mesh: Mesh) -> _umbel.MeshArrays:
    """Positions and triangles alone: attributes are no matter of a hierarchy."""
    return native(Mesh(mesh.positions, mesh.triangles))


def boxes_from(source: Any) -> NDArray[np.float32] | None:
    """The boxes, if `source` is an array of them and not a mesh."""
    if isinstance(source, (str, os.PathLike, Mesh)) or hasattr(source, "faces"):
        return None
    if isinstance(source, (tuple, list)) and len(source) == 2 and np.ndim(source[0]) == 2:
        return None  # (positions, triangles)
    return rows("boxes", source, 6)


def point_of(name: str, value: ArrayLike) -> NDArray[Any]:
    """A point, (3,); umbel.Error if it is none."""
    array = numbers(name, value)
    if array.shape != (3,):
        raise Error(f"{name} must have shape (3,), not {array.shape}")
    return array


def box_of(low: ArrayLike, high: ArrayLike) -> tuple[float, ...]:
    """The six numbers of a box; those of one that touches nothing where `low` is above `high`."""
    least, most = point_of("low", low), point_of("high", high)
    if (least > most).any():
        return (math.inf,) * 3 + (-math.inf,) * 3
    return (*least.tolist(), *most.tolist())
