"""What tests ask of meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from umbel import Mesh

_ODD = np.random.default_rng(20).integers(0, 2**63, 64, dtype=np.uint64) * np.uint64(2) + np.uint64(
    1
)


def _mixed(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    values = (values ^ (values >> np.uint64(31))) * _ODD[60]
    return values ^ (values >> np.uint64(29))


def triangle_keys(mesh: Mesh, attributes: bool = True) -> NDArray[np.uint64]:
    """A sorted 64-bit key a triangle, from its corners' positions (and attributes and material),
    whichever corner comes first. -0 counts as 0."""
    streams = [mesh.positions]
    if attributes:
        streams += [
            s for s in (mesh.normals, mesh.tangents, mesh.uvs, mesh.colors) if s is not None
        ]
    rows = np.hstack(streams).astype(np.float32) + np.float32(0)
    bits = np.ascontiguousarray(rows).view(np.uint32).astype(np.uint64)
    vertex = np.zeros(len(bits), np.uint64)
    for column in range(bits.shape[1]):
        vertex = _mixed(vertex + bits[:, column] * _ODD[column])
    corners = vertex[mesh.triangles]
    first = corners.argmin(axis=1)
    turned = np.take_along_axis(corners, (first[:, None] + np.arange(3)) % 3, axis=1)
    # Equal corners leave the turn open: all three turns are tried and the least key is taken.
    turns = [np.roll(turned, k, axis=1) for k in range(3)]
    keys = np.stack([_mixed(_mixed(_mixed(t[:, 0]) + t[:, 1]) + t[:, 2]) for t in turns]).min(
        axis=0
    )
    if attributes and mesh.material_ids is not None and mesh.material_ids.any():
        keys = _mixed(keys + mesh.material_ids.astype(np.uint64) * _ODD[61])
    return np.sort(keys)


def edge_counts(mesh: Mesh) -> NDArray[np.int64]:
    """How many triangles share each edge, a pair of positions."""
    _, ids = np.unique(mesh.positions + np.float32(0), axis=0, return_inverse=True)
    corners = ids.reshape(-1)[mesh.triangles].astype(np.int64)
    corners = corners[
        (corners[:, 0] != corners[:, 1])
        & (corners[:, 1] != corners[:, 2])
        & (corners[:, 2] != corners[:, 0])
    ]
    ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    ends.sort(axis=1)
    _, counts = np.unique(ends[:, 0] * (1 << 32) + ends[:, 1], return_counts=True)
    return counts


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge is shared by exactly two triangles."""
    return bool((edge_counts(mesh) == 2).all())
