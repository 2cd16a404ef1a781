"""Meshes of tests, and what is asked of meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from helpers.mesh_files import bumpy_sphere
from umbel import Material, Mesh, shapes
from umbel.io.colors import to_linear

_ODD = np.random.default_rng(20).integers(0, 2**63, 64, dtype=np.uint64) * np.uint64(2) + np.uint64(
    1
)


def linear(srgb: object) -> NDArray[np.float64]:
    """Linear channels of those of sRGB, as IEC 61966-2-1 has it."""
    s = np.asarray(srgb, np.float64)
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


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


def full_mesh(seed: int = 0, materials: bool = True) -> Mesh:
    """A mesh with every attribute, whose floats need all their bits."""
    positions, triangles = bumpy_sphere()
    rng = np.random.default_rng(seed)
    n, m = len(positions), len(triangles)
    normals = rng.normal(size=(n, 3))
    along = rng.normal(size=(n, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    tangents = np.concatenate([along, rng.choice([-1.0, 1.0], size=(n, 1))], axis=1)
    colors = rng.integers(0, 256, (n, 4)).astype(np.float32) / np.float32(255)
    colors[:, :3] = to_linear(colors[:, :3])
    return Mesh(
        positions,
        triangles,
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        tangents=tangents,
        uvs=rng.random((n, 2)) * 10 - 5,
        colors=colors,
        material_ids=np.sort(rng.integers(0, 3, m)).astype(np.uint32) if materials else None,
        materials=[
            Material("stone", (0.5, 0.25, 0.125, 1.0), 0.0, 0.5),
            Material("lamp", emissive=(4.0, 2.0, 0.0), double_sided=True),
            Material("leaf", (1.0, 1.0, 1.0, 0.5), alpha_mode="MASK", alpha_cutoff=0.25),
        ]
        if materials
        else [],
        name="full",
    )


def decorated_blob(subdivisions: int) -> Mesh:
    """A closed surface with every attribute."""
    mesh = shapes.blob(subdivisions, seed=3)
    positions = mesh.positions
    normals = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    tangents = np.cross([0.3, 0.5, 0.8], normals)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.where(positions[:, :1] > 0, 1.0, -1.0)
    return Mesh(
        positions=positions,
        triangles=mesh.triangles,
        normals=normals.astype(np.float32),
        tangents=np.hstack([tangents, side]).astype(np.float32),
        uvs=(positions[:, :2] * 2).astype(np.float32),
        colors=np.hstack([np.abs(normals), np.full((len(normals), 1), 0.5)]).astype(np.float32),
    )
