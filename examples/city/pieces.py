"""Parts of a mesh that are collected, and then joined to one."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass
class Pieces:
    """Vertices and triangles of many parts."""

    count: int = 0  #: vertices so far
    positions: list[NDArray[np.float32]] = field(default_factory=list)
    uvs: list[NDArray[np.float32]] = field(default_factory=list)
    triangles: list[NDArray[np.uint32]] = field(default_factory=list)
    materials: list[NDArray[np.uint32]] = field(default_factory=list)

    def add(
        self, positions: ArrayLike, uvs: ArrayLike, triangles: ArrayLike, materials: ArrayLike
    ) -> None:
        """A part with vertices of its own; `materials` is one number or one for each triangle."""
        points, corners = np.asarray(positions, np.float32), np.asarray(triangles, np.uint32)
        self.positions.append(points)
        self.uvs.append(np.asarray(uvs, np.float32))
        self.triangles.append(corners + np.uint32(self.count))
        self.materials.append(np.broadcast_to(np.asarray(materials, np.uint32), len(corners)))
        self.count += len(points)
