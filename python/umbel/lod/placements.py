"""Where very many instances stand, from arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel.errors import Error
from umbel.geometry.arrays import check_affine, numbers

_CHUNK = 1 << 20


class Placements:
    """Instances for `save_asset`, as arrays.

    transforms: (n, 3, 4) or (n, 4, 4): matrices that take column vectors from the meshes to the
        world.
    meshes: (n,) indices of meshes, or one for all.
    """

    def __init__(self, transforms: ArrayLike, meshes: ArrayLike = 0) -> None:
        rows = numbers("transforms", transforms)
        if rows.ndim != 3 or rows.shape[1:] not in ((3, 4), (4, 4)):
            raise Error(f"transforms must have shape (n, 3, 4) or (n, 4, 4), not {rows.shape}")
        check_affine("transforms", rows)
        which = numbers("meshes", meshes)
        if which.dtype.kind not in "iu":
            raise Error(f"meshes must be whole numbers, not {which.dtype}")
        if which.shape not in ((), (len(rows),)):
            raise Error(f"meshes must have shape ({len(rows)},), not {which.shape}")
        self.transforms = rows[:, :3]
        self.meshes: NDArray[np.int64] = np.broadcast_to(which, len(rows)).astype(np.int64)

    def __len__(self) -> int:
        return len(self.transforms)

    def relative(
        self, mesh_origins: Sequence[NDArray[np.float64]], origin: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Which mesh, and the (n, 3, 4) matrices that take meshes without their own origins to the
        world without `origin`."""
        wrong = (self.meshes < 0) | (self.meshes >= len(mesh_origins))
        if wrong.any():
            first = int(np.argmax(wrong))
            raise Error(
                f"instance {first} is of mesh {self.meshes[first]}, "
                f"but there are {len(mesh_origins)}"
            )
        local = np.empty((len(self), 3, 4), np.float32)
        has_origin = origin.any() or any(one.any() for one in mesh_origins)
        origins = np.reshape(mesh_origins, (-1, 3))
        # By parts, as they are doubles in between.
        for begin in range(0, len(self), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            rows = self.transforms[part]
            with np.errstate(over="ignore"):  # what does not fit is refused as not finite
                local[part] = rows
                if has_origin:
                    exact = rows.astype(np.float64)
                    own = origins[self.meshes[part]]
                    moved = np.einsum("nij,nj->ni", exact[:, :, :3], own) - origin
                    local[part, :, 3] = exact[:, :, 3] + moved
        return self.meshes, local
