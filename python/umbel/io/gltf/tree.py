"""What a glTF file says of its scene beside geometry and materials: the tree of nodes with names,
extras, cameras and lights, its skins' joints, and who made it.

It is kept as glTF's own JSON (docs/format.md, section SCEN). Where instances are kept apart, a
node's `instances` are the range of instances that it draws.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np

from umbel.errors import Error
from umbel.geometry.mesh import Float64Array
from umbel.io.gltf.nodes import Nodes, local_matrix

Json = dict[str, Any]

#: Extensions of nodes and of the whole file that mean the same in another file with this tree.
XMP = "KHR_xmp_json_ld"
KEPT = ("KHR_lights_punctual", XMP, "KHR_node_visibility")
#: Extensions that the readers here have done what they ask for.
_DONE = ("EXT_mesh_gpu_instancing",)
#: Extensions whose other half is lost.
_HALF = ("KHR_materials_variants",)
_PLACE = {"matrix", "translation", "rotation", "scale"}
_DRAWN = ("mesh", "skin", "weights", "instances")


class Tree:
    """The tree of a file: those of its nodes that the scene or a skin has."""

    def __init__(self, root: Json, nodes: Nodes, drawn: list[int]) -> None:
        self._root = root
        #: Extensions that are lost, by name.
        self.lost: set[str] = set()
        skins = root.get("skins") or []
        joints = [joint for skin in skins for joint in skin.get("joints") or []]
        chains = [node for joint in joints for node in nodes.ancestors(joint)]
        kept = list(dict.fromkeys([*drawn, *chains]))
        #: The new number of a node by its own.
        self.numbers = {old: new for new, old in enumerate(kept)}
        roots = [k for k in kept if nodes.parent(k) not in self.numbers]
        scene = self._scene()
        self.json: Json = {
            "asset": self._clean(root.get("asset") or {}, "version", "minVersion", "generator"),
            "scenes": [{**scene, "nodes": [self.numbers[k] for k in roots]}],
            "nodes": [self._node(nodes.node(k)) for k in kept],
            "skins": [self._skin(skin) for skin in skins],
            "cameras": copy.deepcopy(root.get("cameras") or []),
            **self._clean({k: root[k] for k in ("extensions", "extras") if k in root}),
        }
        self.json = {key: value for key, value in self.json.items() if value}

    def _scene(self) -> Json:
        scenes = self._root.get("scenes") or [{}]
        return self._clean(scenes[self._root.get("scene", 0)], "nodes")

    def _node(self, node: Json) -> Json:
        out = self._clean(node, "children", *_DRAWN)
        children = [self.numbers[k] for k in node.get("children") or [] if k in self.numbers]
        if children:
            out["children"] = children
        return out

    def _skin(self, skin: Json) -> Json:
        out = {k: copy.deepcopy(v) for k, v in skin.items() if k in ("name", "extras")}
        if skin.get("skeleton") in self.numbers:
            out["skeleton"] = self.numbers[skin["skeleton"]]
        return {**out, "joints": [self.numbers[k] for k in skin.get("joints") or []]}

    def _clean(self, entry: Json, *without: str) -> Json:
        """A copy of an entry with those of its extensions that say the same elsewhere: what is
        not known may refer to what is not there any more, unless it has no integers."""
        out = {k: copy.deepcopy(v) for k, v in entry.items() if k not in without}
        extensions = out.pop("extensions", None) or {}
        kept = {
            k: v for k, v in extensions.items() if k in KEPT or not (k in _HALF or _has_integers(v))
        }
        self.lost.update(k for k in extensions if k not in kept and k not in _DONE)
        if kept:
            out["extensions"] = kept
        return out


def _has_integers(value: Any) -> bool:
    if isinstance(value, dict):
        return any(_has_integers(item) for item in value.values())
    if isinstance(value, list):
        return any(_has_integers(item) for item in value)
    return isinstance(value, int) and not isinstance(value, bool)


def known_packets(root: Json) -> Json:
    """A file's JSON whose materials refer to no XMP packets if it has none: an asset's do where its
    scene is left out."""
    if XMP in (root.get("extensions") or {}):
        return root
    return root | {k: _without(root[k], XMP) for k in ("materials", "textures", "images")}


def _without(value: Any, extension: str) -> Any:
    if isinstance(value, list):
        return [_without(item, extension) for item in value]
    if not isinstance(value, dict):
        return value
    out = {k: v if k == "extras" else _without(v, extension) for k, v in value.items()}
    if extension in (out.get("extensions") or {}):
        del out["extensions"][extension]
        if not out["extensions"]:
            del out["extensions"]
    return out


def check_tree(tree: Json, where: str) -> None:
    """Raises unless tables have objects, nodes, scenes and skins refer to nodes that are there, and
    no node is below two others or itself."""
    every = [tree]
    for table in ("nodes", "scenes", "skins", "meshes", "cameras"):
        entries = tree.get(table, [])
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            raise Error(f"{where}: the {table} of its scene are no list of objects")
        every += entries
    for entry in every:
        for key in ("asset", "extensions", "perspective"):
            if not isinstance(entry.get(key, {}), dict):
                raise Error(f"{where}: the {key} of its scene is no object")
    for camera in tree.get("cameras", []):
        if not isinstance(camera.get("perspective", {}).get("yfov", 0.0), (int, float)):
            raise Error(f"{where}: a camera of its scene has a yfov that is no number")
    nodes = tree.get("nodes", [])
    parents: set[int] = set()
    for node in nodes:
        for child in _references(node, "children", len(nodes), where):
            if child in parents:
                raise Error(f"{where}: the node {child} of its scene has two parents")
            parents.add(child)
    for entry in tree.get("scenes", []):
        _references(entry, "nodes", len(nodes), where)
    for entry in tree.get("skins", []):
        _references(entry, "joints", len(nodes), where)
        given = {"skeletons": [entry["skeleton"]]} if "skeleton" in entry else {}
        _references(given, "skeletons", len(nodes), where)
    below = [k for k in range(len(nodes)) if k not in parents]
    reached = 0
    while below:
        reached += 1
        below += nodes[below.pop()].get("children", [])
    if reached < len(nodes):
        raise Error(f"{where}: a node of its scene is its own ancestor")


def _references(entry: Json, key: str, count: int, where: str) -> list[int]:
    found = entry.get(key, [])
    if not isinstance(found, list) or not all(type(k) is int and 0 <= k < count for k in found):
        raise Error(f"{where}: its scene has {key} that are no nodes of it")
    return found


def worlds(nodes: Sequence[Json]) -> list[Float64Array]:
    """(4, 4) float64 of each node, to the world; of a tree as `Tree` makes it."""
    out = [np.eye(4) for _ in nodes]
    children = {child for node in nodes for child in node.get("children", [])}
    stack = [k for k in range(len(nodes)) if k not in children]
    for root in stack:
        out[root] = local_matrix(nodes[root], f"nodes[{root}]")
    while stack:
        at = stack.pop()
        for child in nodes[at].get("children", []):
            out[child] = out[at] @ local_matrix(nodes[child], f"nodes[{child}]")
            stack.append(child)
    return out


def with_instances(tree: Json, owners: Sequence[int | None], meshes: Sequence[Json]) -> Json:
    """The tree of a scene whose instances are of the nodes `owners`, those of one node one after
    the other; `meshes` are the meshes' names and extras."""
    out = copy.deepcopy(tree)
    nodes = out.get("nodes", [])
    for number, owner in enumerate(owners):
        if owner is None or not 0 <= owner < len(nodes):
            continue
        first, count = nodes[owner].get("instances", (number, 0))
        if first + count == number:
            nodes[owner]["instances"] = [first, count + 1]
    if any(meshes):
        out["meshes"] = list(meshes)
    return out


def owners_of(tree: Json, count: int) -> list[int | None]:
    """The node of each of so many instances: the inverse of `with_instances`. Ranges that make no
    sense count for nothing."""
    owners: list[int | None] = [None] * count
    for k, node in enumerate(tree.get("nodes") or []):
        try:
            first, length = (int(v) for v in node.get("instances", (0, 0)))
        except (TypeError, ValueError, OverflowError):
            continue
        for number in range(max(first, 0), min(first + length, count)):
            owners[number] = k
    return owners


def is_trivial(tree: Json) -> bool:
    """Whether the tree says no more than that there is a mesh where it is."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    return (
        set(tree) <= {"nodes", "scenes"}
        and len(nodes) <= 1
        and all(set(node) <= {"instances"} for node in nodes)
        and all(set(scene) <= {"nodes"} for scene in scenes)
    )


def merged(
    tree: Json, owners: Sequence[int | None], origin: Float64Array | None, name: str, mesh: Json
) -> Json:
    """The tree of a scene that has become one mesh: that of its only node, if the mesh stands in
    its file as in the world, else of a node of its own.

    origin: where the mesh lies, or None if it is a mesh of the file as it stands there.
    mesh: the mesh's name and extras, if it is one of the file's.
    """
    if not tree:
        return {"meshes": [mesh]} if mesh else {}
    out = copy.deepcopy(tree)
    nodes = out.setdefault("nodes", [])
    single = owners[0] if len(owners) == 1 else None
    if single is not None and origin is None:
        nodes[single]["instances"] = [0, 1]
    elif owners:
        called = nodes[single].get("name", name) if single is not None else name
        node: Json = {"name": called} if called else {}
        if origin is not None and origin.any():
            node["translation"] = origin.tolist()
        _put(out, node | {"instances": [0, 1]}, single)
    if mesh:
        out["meshes"] = [mesh]
    return out


def _put(tree: Json, node: Json, instead: int | None) -> None:
    """A new root; in the place of a node that says no more than where it is."""
    roots = tree.setdefault("scenes", [{}])[0].setdefault("nodes", [])
    nodes = tree["nodes"]
    if instead in roots and set(nodes[instead]) <= _PLACE:
        nodes[instead] = node
    else:
        roots.append(len(nodes))
        nodes.append(node)
