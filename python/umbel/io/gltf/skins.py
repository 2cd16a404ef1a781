"""The skin of a glTF file that is written: all joints of the source's skins in one, so that joints
keep their numbers, and vertices stay where they are until a joint moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from umbel.geometry.mesh import Float64Array, Mesh, UInt32Array
from umbel.io.gltf.arrays import Arrays, Json
from umbel.io.gltf.tree import worlds

_MOST_MADE = 0xFFFF


class Skin:
    """One list of joints for every mesh. `nodes` grows by those that the tree does not have: joints
    of meshes that are from no glTF file, and one that moves what no joint does."""

    def __init__(self, tree: Json, nodes: list[Json], meshes: Sequence[Mesh]) -> None:
        skins = tree.get("skins") or []
        named = [joint for skin in skins for joint in skin.get("joints", [])]
        skinned = [mesh for mesh in meshes if has_joints(mesh)]
        count = max((_count(mesh) for mesh in skinned), default=0)
        for number in range(len(named), count if count <= _MOST_MADE + 1 else 0):
            nodes.append({"name": f"joint {number}"})
            named.append(len(nodes) - 1)
        #: The nodes that are joints, each once.
        self.joints = list(dict.fromkeys(named))
        slots = {node: slot for slot, node in enumerate(self.joints)}
        #: The index in `joints` of each of the source's numbers.
        self.numbers: UInt32Array = np.array([slots[node] for node in named], np.uint32)
        #: Those of the source's skins, each once.
        names = (skin.get("name") for skin in skins)
        self.names = list(dict.fromkeys(name for name in names if name and isinstance(name, str)))
        self.extras = [skin["extras"] for skin in skins if "extras" in skin]
        self.skeletons = {skin["skeleton"] for skin in skins if "skeleton" in skin}
        #: The joint of vertices that no other moves.
        self.still = 0
        if any(not mesh.weights.any(axis=1).all() for mesh in skinned if mesh.weights is not None):
            nodes.append({"name": "unskinned"})
            self.still = len(self.joints)
            self.joints.append(len(nodes) - 1)
        #: The node above all joints that the source says, if they are still all below it.
        self.skeleton = next(iter(self.skeletons)) if len(self.skeletons) == 1 else None
        if not self._are_below(self.skeleton, nodes):
            self.skeleton = None
        self._made: dict[bytes, int] = {}
        self.skins: list[Json] = []

    def _are_below(self, top: int | None, nodes: Sequence[Json]) -> bool:
        """Whether all joints are a node or below it."""
        below = set() if top is None else {top}
        waiting = list(below)
        while waiting:
            children = nodes[waiting.pop()].get("children", [])
            below.update(children)
            waiting += children
        return below.issuperset(self.joints)

    def usable(self, nodes: Sequence[Json]) -> bool:
        """Whether every joint's matrix has an inverse."""
        every = worlds(nodes)
        return all(np.linalg.cond(every[k][:3, :3]) < 1e12 for k in self.joints)

    def write(self, arrays: Arrays, every: Sequence[Float64Array], world: Float64Array) -> int:
        """The number of the skin for a mesh that is drawn at the matrix `world`;
        `every` are the world matrices of all nodes."""
        key = world.tobytes()
        if key not in self._made:
            inverse = np.array([np.linalg.inv(every[k]) @ world for k in self.joints])
            inverse[:, 3] = (0, 0, 0, 1)
            columns = inverse.transpose(0, 2, 1).reshape(-1, 16)
            skin: Json = {"inverseBindMatrices": arrays.array(columns, "MAT4")}
            if self.names:
                skin["name"] = self.names[0]
            if len(self.extras) == 1:
                skin["extras"] = self.extras[0]
            if self.skeleton is not None:
                skin["skeleton"] = self.skeleton
            self._made[key] = len(self.skins)
            self.skins.append({**skin, "joints": self.joints})
        return self._made[key]


def has_joints(mesh: Mesh) -> bool:
    return mesh.joints is not None and mesh.weights is not None and bool(mesh.weights.any())


def _count(mesh: Mesh) -> int:
    assert mesh.joints is not None and mesh.weights is not None
    return int(mesh.joints[mesh.weights != 0].max(initial=0)) + 1


def common_root(scene: Json, nodes: list[Json], joints: Sequence[int]) -> None:
    """Puts the scene's roots below one node where the joints have none in common."""
    parents = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}

    def root(node: int) -> int:
        while node in parents:
            node = parents[node]
        return node

    if len({root(joint) for joint in joints}) > 1:
        nodes.append({"children": scene["nodes"]})
        scene["nodes"] = [len(nodes) - 1]
