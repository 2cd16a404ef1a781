"""Instances as nodes of a glTF file that is written: on the node that each comes from where that
has the same matrix, else below it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from umbel.geometry.mesh import Float64Array
from umbel.io.gltf.arrays import Json

_SAME = 2.0**-40
"""Two matrices are the same if they differ by less, relative to their largest entry."""
_INVERTIBLE = 1e10


def attach(
    nodes: list[Json],
    roots: list[int],
    every: Sequence[Float64Array],
    owner: int | None,
    matrix: Float64Array,
    entry: Json,
) -> int:
    """Gives a mesh (`entry`: what its node says of it) a node at `matrix`, and returns that. Its
    `owner` in the tree is the node, or the parent of a new one; `every` are the world matrices of
    the tree."""
    if owner is not None:
        world = every[owner]
        if same_matrix(world, matrix) and "mesh" not in nodes[owner]:
            nodes[owner] |= {k: v for k, v in entry.items() if k != "name"}
            return owner
        if np.linalg.cond(world) < _INVERTIBLE:
            made = _nodes_at(nodes, np.linalg.inv(world) @ matrix, entry)
            nodes[owner].setdefault("children", []).append(made)
            return made
    made = _nodes_at(nodes, matrix, entry)
    roots.append(made)
    return made


def same_matrix(a: Float64Array, b: Float64Array) -> bool:
    """Whether two matrices are the same but for rounding: the linear part and the translation, each
    relative to its own largest entry."""
    for part in (np.s_[:3, :3], np.s_[:3, 3]):
        most = max(float(np.abs(a[part]).max()), float(np.abs(b[part]).max()))
        if not np.abs(a[part] - b[part]).max() <= _SAME * most:
            return False
    return True


def _nodes_at(nodes: list[Json], matrix: Float64Array, entry: Json) -> int:
    """A node with this matrix to its parent; two where shear is more than one can say."""
    linear, moved = matrix[:3, :3], matrix[:3, 3]
    node = dict(entry)
    if moved.any():
        node["translation"] = moved.tolist()
    if np.array_equal(linear, np.eye(3)):
        nodes.append(node)
        return len(nodes) - 1
    lengths = np.linalg.norm(linear, axis=0)
    cosines = linear.T @ linear - np.diag(lengths**2)
    if np.abs(cosines).max() <= 1e-6 * lengths.max() ** 2:
        node.pop("translation", None)
        nodes.append({**node, "matrix": matrix.T.reshape(-1).tolist()})
        return len(nodes) - 1
    left, factors, right = np.linalg.svd(linear)
    if np.linalg.det(left) < 0:
        left, factors = left * (1, 1, -1), factors * (1, 1, -1)
    if np.linalg.det(right) < 0:
        right, factors = right * np.array([[1], [1], [-1]]), factors * (1, 1, -1)
    nodes.append({**entry, "rotation": _quaternion(right)})
    outer: Json = {"rotation": _quaternion(left), "scale": factors.tolist()}
    if moved.any():
        outer["translation"] = moved.tolist()
    nodes.append({**outer, "children": [len(nodes) - 1]})
    return len(nodes) - 1


def _quaternion(turn: Float64Array) -> list[float]:
    """(x, y, z, w) of a rotation matrix: the eigenvector of Bar-Itzhack's matrix (2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn
    symmetric = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    values, vectors = np.linalg.eigh(symmetric / 3)
    out: list[float] = vectors[:, int(np.argmax(values))].tolist()
    return out
