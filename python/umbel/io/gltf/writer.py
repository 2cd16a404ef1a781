"""Writes a scene as glTF, .glb or .gltf with a .bin: meshes, each once, on the nodes of the tree
that they are from, with their materials, images, skin, cameras and lights."""

from __future__ import annotations

import contextlib
import copy
import json
import urllib.parse
from pathlib import Path

import numpy as np

from umbel.errors import Error, warn_lost
from umbel.geometry.mesh import Mesh
from umbel.io.files import replacing_together, write_all
from umbel.io.format_losses import reference_losses
from umbel.io.gltf.arrays import Arrays, Json
from umbel.io.gltf.attach import attach
from umbel.io.gltf.material_table import MaterialTable
from umbel.io.gltf.materials import extensions_in
from umbel.io.gltf.primitives import write_primitives
from umbel.io.gltf.skins import Skin, common_root, has_joints
from umbel.io.gltf.tree import check_tree, known_packets, worlds
from umbel.io.references import named_files
from umbel.io.scene import Instance, Scene
from umbel.io.side_names import SideNames
from umbel.plain_json import plain

_MOST_BYTES = 0xFFFFFFFF
_GENERATOR = "umbel"


def write_gltf(path: Path, scene: Scene) -> None:
    """Writes the scene; every float of it is kept to the bit, and so is every image. One warning
    names what glTF cannot hold."""
    arrays = Arrays()
    try:
        root, lost = _Writer(arrays, scene, path.stem).root()
    except Error as error:
        raise Error(f"cannot write {path}: {error}") from None
    if path.suffix.lower() == ".gltf":
        _write_apart(path, root, arrays)
    else:
        write_all(path, _glb(path, root, arrays))
    said = next((mesh.coordinates for mesh in scene.meshes if mesh.coordinates), {})
    lost += reference_losses(path, said)
    if lost:
        warn_lost(f"{path} was written without", lost)


class _Writer:
    def __init__(self, arrays: Arrays, scene: Scene, name: str) -> None:
        self.arrays, self.scene, self.name = arrays, scene, name
        self.lost: list[str] = []
        self.materials = MaterialTable(self._keep_image, scene.materials, self.lost)
        tree = scene.tree
        check_tree(tree, scene.name or "the scene")
        for number, instance in enumerate(scene.instances):
            if not 0 <= instance.mesh < len(scene.meshes):
                raise Error(
                    f"instance {number} is of mesh {instance.mesh}, there are {len(scene.meshes)}"
                )
            if not np.isfinite(instance.transform).all():
                raise Error(f"instance {number} has a transform that is not finite")
        self.nodes: list[Json] = [_node(node) for node in tree.get("nodes", [])]
        self.every = worlds(self.nodes)
        self.entry: Json = copy.deepcopy((tree.get("scenes") or [{}])[0])
        self.roots: list[int] = self.entry.pop("nodes", [])
        self.skin = self._skin()
        self.meshes: list[Json] = []
        self._numbers: dict[int, int] = {}

    def root(self) -> tuple[Json, list[str]]:
        """The file's JSON, and what is lost."""
        used = {instance.mesh for instance in self.scene.instances}
        if len(used) < len(self.scene.meshes):
            self.lost.append("meshes without an instance")
        drawn = [self.scene.meshes[k] for k in sorted(used)]
        if any(len(mesh.positions) and not len(mesh.triangles) for mesh in drawn):
            self.lost.append("vertices of meshes without triangles")
        if any(_names_missing(mesh) for mesh in drawn):
            self.lost.append("numbers of materials that are not there")
        if any(mesh.material_ids is not None for mesh in drawn):
            self.materials.write()
        for instance in self.scene.instances:
            if len(self.scene.meshes[instance.mesh].triangles):
                self._place(instance)
        tree = self.scene.tree
        root: Json = {
            "asset": {**tree.get("asset", {}), "version": "2.0", "generator": _GENERATOR},
            "scene": 0,
            "scenes": [self._scene()],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "skins": self.skin.skins if self.skin else [],
            "materials": self.materials.entries,
            **self.materials.table.root,
            "cameras": tree.get("cameras", []),
            **{key: tree[key] for key in ("extensions", "extras") if key in tree},
            "accessors": self.arrays.accessors,
            "bufferViews": self.arrays.views,
        }
        root = known_packets(root)
        root["extensionsUsed"] = sorted(extensions_in(root))
        root["extensionsRequired"] = sorted(self.materials.table.required)
        return {key: value for key, value in root.items() if value not in ([], {})}, self.lost

    def _keep_image(self, data: bytes, _: str) -> Json:
        return {"bufferView": self.arrays.blob(data)}

    def _scene(self) -> Json:
        entry = {**self.entry, "nodes": self.roots}
        if self.skin and self.skin.skins:
            common_root(entry, self.nodes, self.skin.joints)
        return entry if entry["nodes"] else self.entry

    def _skin(self) -> Skin | None:
        meshes = [self.scene.meshes[k] for k in {i.mesh for i in self.scene.instances}]
        if not any(has_joints(mesh) for mesh in meshes):
            return None
        before = len(self.nodes)
        skin = Skin(self.scene.tree, self.nodes, meshes)
        if len(skin.extras) > 1:
            self.lost.append("the extras of skins, as they become one")
        if len(skin.names) > 1:
            self.lost.append("the names of skins but the first, as they become one")
        if skin.skeletons and skin.skeleton is None:
            self.lost.append("the skeleton of skins")
        if skin.usable(self.nodes):
            self.roots += range(before, len(self.nodes))
            self.every = worlds(self.nodes)
            return skin
        del self.nodes[before:]
        self.lost.append("joints and weights, as a joint has no size in the rest pose")
        return None

    def _place(self, instance: Instance) -> None:
        mesh = self.scene.meshes[instance.mesh]
        world = np.array(instance.transform, np.float64)
        world[:3, 3] += world[:3, :3] @ mesh.origin
        entry: Json = {"mesh": self._mesh(instance.mesh)}
        if instance.name:
            entry["name"] = instance.name
        if self.skin is None or not has_joints(mesh):
            attach(self.nodes, self.roots, self.every, instance.node, world, entry)
            return
        # Joints alone say where a skinned mesh is; its node's matrix does not count.
        entry["skin"] = self.skin.write(self.arrays, self.every, world)
        where = np.eye(4) if instance.node is None else self.every[instance.node]
        attach(self.nodes, self.roots, self.every, instance.node, where, entry)

    def _mesh(self, index: int) -> int:
        if index not in self._numbers:
            mesh = self.scene.meshes[index]
            if mesh.colors is not None and not ((mesh.colors >= 0) & (mesh.colors <= 1)).all():
                self.lost.append("colours outside 0 to 1, which become 0 or 1")
            primitives = write_primitives(self.arrays, mesh, self.materials.number, self.skin)
            entry: Json = {"name": mesh.name or self.name, "primitives": primitives}
            if mesh.extras is not None:
                entry["extras"] = mesh.extras
            self._numbers[index] = len(self.meshes)
            self.meshes.append(entry)
        return self._numbers[index]


def _names_missing(mesh: Mesh) -> bool:
    """Whether a triangle has the number of a material that is not there."""
    ids = mesh.material_ids
    return ids is not None and bool((ids >= len(mesh.materials)).any())


def _node(node: Json) -> Json:
    """A node of the tree as a file may have it."""
    out = {key: copy.deepcopy(value) for key, value in node.items() if key != "instances"}
    if "matrix" in out:
        out = {k: v for k, v in out.items() if k not in ("translation", "rotation", "scale")}
    if "rotation" in out:
        turn = np.array(out["rotation"], np.float64)
        length = float(np.linalg.norm(turn))
        if not abs(length - 1) < 1e-3:
            out["rotation"] = (turn / length).tolist() if length > 0 else [0, 0, 0, 1]
    return out


def _text(root: Json) -> bytes:
    return json.dumps(plain(root), separators=(",", ":"), allow_nan=False).encode()


def _glb(path: Path, root: Json, arrays: Arrays) -> list[bytes]:
    if arrays.size:
        root["buffers"] = [{"byteLength": arrays.size}]
    text = _text(root)
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + (8 + arrays.size if arrays.size else 0)
    if total > _MOST_BYTES:
        raise Error(f"cannot write {path}: {total} bytes are more than a .glb can hold")

    def word(*values: int) -> bytes:
        return b"".join(v.to_bytes(4, "little") for v in values)

    out = [b"glTF", word(2, total), word(len(text)), b"JSON", text]
    if arrays.size:
        out += [word(arrays.size), b"BIN\0", *arrays.chunks]
    return out


def _written_with(path: Path) -> set[str]:
    """The buffers that were written with a glTF file, where it is ours."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, RecursionError):
        if json.loads(path.read_bytes())["asset"]["generator"] == _GENERATOR:
            return named_files(path)
    return set()


def _write_apart(path: Path, root: Json, arrays: Arrays) -> None:
    with replacing_together() as opened:
        if arrays.size:
            name = SideNames(path, _written_with).new(path.stem, ".bin", arrays.chunks)
            uri = urllib.parse.quote(name, errors="surrogateescape")
            root["buffers"] = [{"byteLength": arrays.size, "uri": uri}]
            with opened(path.with_name(name)) as file:
                file.writelines(arrays.chunks)
        with opened(path) as file:
            file.write(_text(root))
