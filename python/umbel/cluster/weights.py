"""What keeps triangles together besides where they are: named weights of connections."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error

#: Each name's weight where none is given. Of shared vertices it is where most of what weights can
#: save is saved, at little loss of fill.
DEFAULTS = {"shared-vertices": 0.3, "normals": 4.0}


def weights_of(text: str) -> dict[str, float]:
    """`none`, or names and perhaps their weights, as in `shared-vertices=0.3,normals=2`."""
    if text == "none":
        return {}
    found = {}
    for word in text.split(","):
        name, equals, given = word.strip().partition("=")
        if name not in DEFAULTS:
            known = ", ".join(DEFAULTS)
            raise Error(f"weights must be none or a mix of {known}, not {word.strip()!r}")
        if name in found:
            raise Error(f"weights name {name} twice")
        try:
            found[name] = float(given) if equals else DEFAULTS[name]
        except ValueError:
            found[name] = math.nan
        if not 0 <= found[name] < math.inf:
            raise Error(f"the weight of {name} must be a number of at least 0, not {given!r}")
    return found


def normal_connections(
    positions: NDArray[Any], triangles: NDArray[Any], weight: float
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]:
    """Connections between triangles that share an edge, as `build_clusters` takes them: `weight`
    times the cosine of the angle between their normals, at least 0. Across an edge of more than
    two triangles each is connected to the next."""
    count = len(triangles)
    corners = triangles.astype(np.int64)
    ends = np.stack([corners, np.roll(corners, -1, 1)], -1).reshape(-1, 2)
    ends.sort(axis=1)
    keys = ends[:, 0] * max(len(positions), 1) + ends[:, 1]
    order = np.argsort(keys, kind="stable")
    owner = np.repeat(np.arange(count), 3)[order]
    is_same = keys[order][1:] == keys[order][:-1]
    a, b = owner[:-1][is_same], owner[1:][is_same]
    a, b = a[a != b], b[a != b]
    normals = face_normals(positions, triangles)
    cosines = np.maximum(np.einsum("ij,ij->i", normals[a], normals[b]), 0.0)
    source, target = np.concatenate([a, b]), np.concatenate([b, a])
    weights = np.concatenate([cosines, cosines]) * weight
    by_source = np.argsort(source, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(source, minlength=count))])
    return (
        offsets.astype(np.uint32),
        target[by_source].astype(np.uint32),
        weights[by_source].astype(np.float32),
    )


def face_normals(positions: NDArray[Any], triangles: NDArray[Any]) -> NDArray[np.float64]:
    """(n, 3) of unit length; zero where a triangle has no area."""
    corners = positions.astype(np.float64)[triangles]
    # Scaled first, so that products of tiny or huge edges are numbers.
    edges = corners[:, 1:] - corners[:, :1]
    largest = np.abs(edges).max(axis=(1, 2), initial=0.0)
    edges /= np.where(largest > 0, largest, 1.0)[:, None, None]
    normals = np.cross(edges[:, 0], edges[:, 1])
    lengths = np.linalg.norm(normals, axis=1)
    unit: NDArray[np.float64] = normals / np.where(lengths > 0, lengths, 1.0)[:, None]
    return unit
