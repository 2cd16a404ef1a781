"""Skirts: strips that hang from a tile's borders into the body, and cover the gaps beside tiles of
another error (Ulrich, *Rendering massive terrains using chunked level of detail control*, 2002)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from umbel.export.piece import Doubles, Indices, Piece
from umbel.geometry.mesh import area_weighted_normals


def with_skirts(piece: Piece, low: Doubles, high: Doubles, length: float) -> Piece:
    """The piece of a cell with a strip so long along every open edge that lies in one of the planes
    around the cell. Strips stay within the plane and the cell."""
    if length <= 0:
        return piece
    normals = area_weighted_normals(
        (piece.points - low).astype(np.float32), piece.triangles
    ).astype(np.float64)
    for axis in range(3):
        for value in (low[axis], high[axis]):
            piece, normals = _along(piece, normals, axis, value, low, high, length)
    return piece


def _along(
    piece: Piece,
    normals: Doubles,
    axis: int,
    value: float,
    low: Doubles,
    high: Doubles,
    length: float,
) -> tuple[Piece, Doubles]:
    edges, owner = _open_edges(piece, piece.points[:, axis] == value)
    if not len(edges):
        return piece, normals
    top, corners = np.unique(edges, return_inverse=True)
    corners = corners.reshape(-1, 2)
    down = -normals[top]
    down[:, axis] = 0
    size = np.linalg.norm(down, axis=1, keepdims=True)
    down = np.divide(down, size, out=np.zeros_like(down), where=size > 0)
    points = np.clip(piece.points[top] + length * down, low, high)
    points[:, axis] = value
    first = len(piece.points)
    a, b = edges.T
    below_a, below_b = (first + corners).T
    triangles = np.concatenate(
        [np.stack([b, a, below_a], axis=1), np.stack([b, below_a, below_b], axis=1)]
    ).astype(np.uint32)
    materials = None
    if piece.materials is not None:
        materials = np.concatenate([piece.materials[owner]] * 2)
    columns = {k: v[top] for k, v in piece.columns.items()}
    return piece.joined(points, columns, triangles, materials), np.concatenate(
        [normals, normals[top]]
    )


def _open_edges(piece: Piece, on_plane: NDArray[np.bool_]) -> tuple[Indices, NDArray[np.intp]]:
    """(e, 2) directed edges in the plane that one triangle has, and that triangle."""
    t = piece.triangles
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    owner = np.tile(np.arange(len(t)), 3)
    inside = on_plane[edges].all(axis=1)
    edges, owner = edges[inside], owner[inside]
    # By positions: attributes split vertices.
    _, same = np.unique(piece.points[edges.reshape(-1)], axis=0, return_inverse=True)
    ends = np.sort(same.reshape(-1, 2), axis=1)
    _, number, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    alone = count[number.reshape(-1)] == 1
    return edges[alone], owner[alone]
