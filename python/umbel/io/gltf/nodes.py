"""The node tree of a glTF asset: world matrices, joints, instances."""

from __future__ import annotations

from itertools import accumulate
from typing import Any

import numpy as np

from umbel.errors import Error
from umbel.geometry.mesh import Float64Array
from umbel.io.gltf.buffers import Buffers, Json


class Nodes:
    """World matrices of all nodes, of any scene or none (as joints may be)."""

    def __init__(self, buffers: Buffers) -> None:
        self.buffers = buffers
        self.where = buffers.where
        entries = buffers.root.get("nodes") or []
        self._count = len(entries)
        self._children = [self._child_list(self.node(k), k) for k in range(self._count)]
        self._parents = self._parents_of_all()
        self._worlds: dict[int, Float64Array] = {}
        skins = buffers.root.get("skins") or []
        counts = [len(skin.get("joints") or []) for skin in skins]
        self._first_joints = list(accumulate(counts, initial=0))
        self._check_tree()

    def node(self, index: int) -> Json:
        return self.buffers.item("nodes", index, "a node")

    def _child_list(self, node: Json, index: int) -> list[int]:
        children = node.get("children") or []
        for child in children:
            self.buffers.item("nodes", child, f"nodes[{index}]")
        return list(children)

    def _parents_of_all(self) -> list[int | None]:
        parents: list[int | None] = [None] * self._count
        for k, children in enumerate(self._children):
            for child in children:
                if parents[child] is not None:
                    raise Error(
                        f"{self.where}: nodes[{child}] has two parents, {parents[child]} and {k}"
                    )
                parents[child] = k
        return parents

    def _check_tree(self) -> None:
        reached = 0
        stack = [k for k, parent in enumerate(self._parents) if parent is None]
        seen = [False] * self._count
        while stack:
            index = stack.pop()
            seen[index] = True
            reached += 1
            stack.extend(self._children[index])
        if reached != self._count:
            raise Error(f"{self.where}: nodes[{seen.index(False)}] is its own ancestor")

    def drawn(self) -> list[int]:
        """The nodes of the default scene, parents before children; without scenes, all."""
        root = self.buffers.root
        if not root.get("scenes"):
            roots = [k for k, parent in enumerate(self._parents) if parent is None]
        else:
            scene = self.buffers.item("scenes", root.get("scene", 0), "the asset")
            roots = scene.get("nodes") or []
        out: list[int] = []
        stack = list(reversed(roots))
        seen: set[int] = set()
        while stack:
            index = stack.pop()
            self.buffers.item("nodes", index, "the scene")
            if index in seen:
                raise Error(f"{self.where}: the scene has nodes[{index}] twice")
            seen.add(index)
            out.append(index)
            stack.extend(reversed(self._children[index]))
        return out

    def world(self, index: int) -> Float64Array:
        """(4, 4) float64, node to world."""
        chain = []
        at: int | None = index
        while at is not None and at not in self._worlds:
            chain.append(at)
            at = self._parents[at]
        matrix = np.eye(4) if at is None else self._worlds[at]
        for k in reversed(chain):
            matrix = matrix @ local_matrix(self.node(k), f"{self.where}: nodes[{k}]")
            self._worlds[k] = matrix
        return matrix

    def parent(self, index: int) -> int | None:
        return self._parents[index]

    def ancestors(self, index: int) -> list[int]:
        """The node itself and all above it, the root first."""
        self.node(index)
        chain = []
        at: int | None = index
        while at is not None:
            chain.append(at)
            at = self._parents[at]
        return chain[::-1]

    def first_joint(self, skin: int) -> int:
        """The number of a skin's first joint, counted through the file's skins."""
        return self._first_joints[skin]

    def joint_matrices(self, skin: Any, user: str) -> Float64Array:
        """(joints, 4, 4) float64, from the skin's bind pose to the world in the rest pose."""
        entry = self.buffers.item("skins", skin, user)
        joints = entry.get("joints") or []
        for joint in joints:
            self.buffers.item("nodes", joint, f"skins[{skin}]")
        worlds = np.array([self.world(j) for j in joints]).reshape(-1, 4, 4)
        if "inverseBindMatrices" not in entry:
            return worlds
        inverse = self.buffers.floats(entry["inverseBindMatrices"], f"skins[{skin}]")
        if inverse.shape[1] != 16 or len(inverse) < len(joints):
            raise Error(f"{self.where}: skins[{skin}] has too few inverse bind matrices")
        columns = inverse[: len(joints)].reshape(-1, 4, 4).astype(np.float64)
        return _snapped(worlds @ columns.transpose(0, 2, 1), worlds)


def _snapped(matrices: Float64Array, worlds: Float64Array) -> Float64Array:
    """The identity for joints that differ from it by no more than the rounding of inverse bind
    matrices: vertices of a mesh that was bound in this pose then keep every bit."""
    with np.errstate(all="ignore"):
        size = 1 + np.abs(worlds[:, :3]).max(axis=(1, 2), initial=0.0)
        near = np.abs(matrices - np.eye(4)).max(axis=(1, 2), initial=0.0) <= 2.0**-21 * size
    return np.where(near[:, None, None], np.eye(4), matrices)


def instance_matrices(node: Json, buffers: Buffers, index: int) -> list[Float64Array]:
    """The matrices of EXT_mesh_gpu_instancing, or the identity alone."""
    extension = (node.get("extensions") or {}).get("EXT_mesh_gpu_instancing")
    if not extension:
        return [np.eye(4)]
    name = f"nodes[{index}] instances"
    attributes = extension.get("attributes") or {}
    if not attributes:
        return [np.eye(4)]
    given = {
        key: buffers.floats(accessor, name)
        for key, accessor in attributes.items()
        if key in ("TRANSLATION", "ROTATION", "SCALE")
    }
    counted = given.values() or [buffers.array(a, name)[0] for a in attributes.values()]
    counts = {len(values) for values in counted}
    if len(counts) != 1:
        raise Error(f"{buffers.where}: {name} have attributes of different counts")
    n = counts.pop()
    translation = given.get("TRANSLATION", np.zeros((n, 3), np.float32))
    rotation = given.get("ROTATION", np.tile(np.array([0, 0, 0, 1], np.float32), (n, 1)))
    scale = given.get("SCALE", np.ones((n, 3), np.float32))
    if (translation.shape[1], rotation.shape[1], scale.shape[1]) != (3, 4, 3):
        raise Error(f"{buffers.where}: {name} have attributes of the wrong width")
    return list(composed(translation, rotation, scale))


def local_matrix(node: Json, what: str) -> Float64Array:
    """(4, 4) float64, node to its parent."""
    if "matrix" in node:
        values = _vector(node["matrix"], 16, what, "matrix")
        matrix: Float64Array = values.reshape(4, 4).T
        return matrix
    translation = _vector(node.get("translation", (0, 0, 0)), 3, what, "translation")
    rotation = _vector(node.get("rotation", (0, 0, 0, 1)), 4, what, "rotation")
    scale = _vector(node.get("scale", (1, 1, 1)), 3, what, "scale")
    out: Float64Array = composed(translation[None], rotation[None], scale[None])[0]
    return out


def _vector(values: Any, size: int, what: str, key: str) -> Float64Array:
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (size,):
        raise Error(f"{what} has a {key} that is not {size} numbers")
    return array


def composed(translation: Any, rotation: Any, scale: Any) -> Float64Array:
    """(n, 4, 4) from translations, unit quaternions (x, y, z, w) and scales."""
    q = np.asarray(rotation, np.float64)
    with np.errstate(all="ignore"):
        length = np.sqrt((q * q).sum(axis=1, keepdims=True))
        q = np.where(length > 0, q / np.where(length > 0, length, 1), [0.0, 0.0, 0.0, 1.0])
    x, y, z, w = q.T
    out = np.zeros((len(q), 4, 4))
    out[:, 0, 0], out[:, 0, 1] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w)
    out[:, 0, 2], out[:, 1, 0] = 2 * (x * z + y * w), 2 * (x * y + z * w)
    out[:, 1, 1], out[:, 1, 2] = 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    out[:, 2, 0], out[:, 2, 1] = 2 * (x * z - y * w), 2 * (y * z + x * w)
    out[:, 2, 2] = 1 - 2 * (x * x + y * y)
    out[:, :3, :3] *= np.asarray(scale, np.float64)[:, None, :]
    out[:, :3, 3] = translation
    out[:, 3, 3] = 1.0
    return out
