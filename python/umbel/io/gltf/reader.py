"""glTF 2.0, .gltf and .glb: what a scene draws, in the rest pose.

Every primitive mode that makes triangles, sparse and normalised accessors, skins, default morph
weights, and the extensions KHR_mesh_quantization, KHR_draco_mesh_compression,
EXT_meshopt_compression and EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.geometry.camera import Camera
from umbel.geometry.mesh import (
    Float32Array,
    Float64Array,
    Material,
    Mesh,
    UInt32Array,
    normalized,
    unit_normals,
)
from umbel.io.coordinates import GLTF
from umbel.io.folder import Folder
from umbel.io.gltf.buffers import MESHOPT, Buffers, Json, parse_container
from umbel.io.gltf.cameras import read_camera
from umbel.io.gltf.images import texture_reader
from umbel.io.gltf.losses import idle_images, idle_nodes, losses, missing_textures, unknown_names
from umbel.io.gltf.materials import read_material
from umbel.io.gltf.nodes import Nodes, instance_matrices
from umbel.io.gltf.schema import check_schema
from umbel.io.gltf.tree import Tree
from umbel.io.polygons import fans, strips
from umbel.io.scene import NO_MATERIAL, Instance, Part, Scene, join, place_skins, with_default

_DRACO = "KHR_draco_mesh_compression"
_UNDERSTOOD = {
    _DRACO,
    *MESHOPT,
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "KHR_xmp_json_ld",
    "KHR_node_visibility",
}
#: Extensions that change shading, but not geometry.
_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_")
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_WIDTHS = {"POSITION": 3, "NORMAL": 3, "TANGENT": 4}
_NUMBERED_WIDTHS = {"TEXCOORD": 2, "JOINTS": 4, "WEIGHTS": 4}
#: How the names of attributes begin that morph targets move.
_MORPHED = ("POSITION", "NORMAL", "TANGENT", "TEXCOORD_", "COLOR_0")
MOST_UVS, _MOST_SKIN_SETS = 7, 3


def read_gltf(data: bytes, where: str, folder: Folder | None = None) -> Scene:
    """The scene in a .gltf or .glb file's bytes; `where` names the file in errors, external
    buffers are read from `folder`."""
    root, binary = parse_container(data, where)
    return read_root(root, binary, where, folder)


def read_root(
    root: Json, binary: bytes | None, where: str, folder: Folder | None, warn: bool = True
) -> Scene:
    """The scene of parsed JSON and the binary chunk beside it. One warning names what is left out
    of it."""
    check_schema(root, where)
    check_header(root, where)
    reader = _Reader(Buffers(root, binary, where, folder))
    scene = reader.scene()
    reader.lost += unknown_names(root)
    if not scene.instances and (root.get("meshes") or root.get("nodes")):
        lost = f" ({'; '.join(reader.lost)})" if reader.lost else ""
        raise Error(f"{where} draws no triangles: it is no mesh{lost}")
    if reader.lost and warn:
        sentence = f"{where}: left out: {'; '.join(reader.lost)}"
        warnings.warn(sentence, LoadWarning, stacklevel=2)
    return scene


def check_header(root: Json, where: str) -> None:
    version = str((root.get("asset") or {}).get("version", ""))
    if not version.startswith("2."):
        raise Error(f"{where}: glTF version {version or '(none)'!s}, only 2 can be read")
    for name in root.get("extensionsRequired") or []:
        if name not in _UNDERSTOOD and not str(name).startswith(_LOOKS):
            raise Error(f"{where} requires the glTF extension {name}, which is not supported")


class _Reader:
    def __init__(self, buffers: Buffers) -> None:
        self.buffers = buffers
        self.where = buffers.where
        self.root = buffers.root
        self.nodes = Nodes(buffers)
        #: What is left out, in words.
        self.lost: list[str] = []
        self.textures = texture_reader(buffers, self.lost)
        entries = self.root.get("materials") or []
        self.materials = [read_material(entry, self.textures.image) for entry in entries]
        self.meshes: list[Mesh] = []
        self.cameras: list[Camera] = []
        self._made: dict[tuple[Any, ...], int | None] = {}
        self._skinned: list[Float64Array] = []  # positions of the mesh's blocks, if it has a skin
        self._exact: dict[int, Float64Array] = {}  # of such meshes, before rounding

    def scene(self) -> Scene:
        instances: list[Instance] = []
        drawn = self.nodes.drawn()
        tree = Tree(self.root, self.nodes, drawn)
        for index in drawn:
            node = self.nodes.node(index)
            if "camera" in node:
                self._add_camera(index, node)
            if "mesh" not in node:
                continue
            mesh = self._mesh_of(index, node)
            if mesh is None:
                continue
            name = str(node.get("name", ""))
            world = np.eye(4) if "skin" in node else self.nodes.world(index)
            for matrix in instance_matrices(node, self.buffers, index):
                instances.append(Instance(mesh, world @ matrix, name, tree.numbers[index]))
        self.lost += losses(self.root, [self.nodes.node(k) for k in drawn], tree.lost)
        self.lost += idle_nodes(self.root, len(tree.numbers))
        self.lost += missing_textures(len(self.textures.missing))
        self.lost += idle_images(self.textures.idle)
        scene = Scene(self.meshes, self.materials, instances, cameras=self.cameras, tree=tree.json)
        place_skins(scene, self._exact)
        return self._with_materials(scene)

    def _add_camera(self, index: int, node: Json) -> None:
        entry = self.buffers.item("cameras", node["camera"], f"nodes[{index}]")
        name = str(node.get("name") or entry.get("name") or "")
        camera = read_camera(entry, name, self.nodes.world(index))
        if camera is not None:
            self.cameras.append(camera)

    def _with_materials(self, scene: Scene) -> Scene:
        """Gives the scene and each of its meshes the same list, with a default if one is needed."""
        if not any(m.material_ids is not None for m in scene.meshes):
            return replace(scene, materials=self.materials)
        every = np.concatenate([m.material_ids for m in scene.meshes if m.material_ids is not None])
        materials, _ = with_default(self.materials, every)
        for mesh in scene.meshes:
            mesh.materials = materials
            if mesh.material_ids is not None:
                _, mesh.material_ids = with_default(self.materials, mesh.material_ids)
        return replace(scene, materials=materials)

    def _mesh_of(self, node_index: int, node: Json) -> int | None:
        user = f"nodes[{node_index}]"
        entry = self.buffers.item("meshes", node["mesh"], user)
        weights = node.get("weights", entry.get("weights"))
        key = (node["mesh"], node.get("skin"), tuple(weights or ()))
        if key not in self._made:
            joints = None if "skin" not in node else self.nodes.joint_matrices(node["skin"], user)
            first = self.nodes.first_joint(node.get("skin", 0))
            mesh = self._mesh(entry, node["mesh"], weights or [], joints, first)
            self._made[key] = None if mesh is None else len(self.meshes)
            if mesh is not None:
                self.meshes.append(mesh)
        return self._made[key]

    def _mesh(
        self,
        entry: Json,
        index: int,
        weights: list[float],
        joints: Float64Array | None,
        first_joint: int,
    ) -> Mesh | None:
        blocks: list[Mesh] = []
        parts: list[Part] = []
        shared: dict[str, int] = {}
        self._skinned = []
        for k, primitive in enumerate(entry.get("primitives") or []):
            name = f"meshes[{index}].primitives[{k}]"
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                continue
            if "POSITION" not in (primitive.get("attributes") or {}):
                self.lost.append(f"{name}, which has no POSITION")
                continue
            block, corners = self._primitive(
                primitive, name, weights, joints, first_joint, shared, blocks
            )
            material = primitive.get("material")
            if material is not None:
                self.buffers.item("materials", material, name)
            if mode == _TRIANGLES and len(corners) % 3:
                self.lost.append(f"indices of {name} after the last whole triangle")
            is_draco = _DRACO in (primitive.get("extensions") or {})
            mode = _TRIANGLES if is_draco else mode
            count = len(blocks[block].positions)
            restart = None if mode == _TRIANGLES else self._restart(primitive, count)
            triangles = _triangulated(corners, mode, restart)
            ids = np.full(len(triangles), NO_MATERIAL if material is None else material, np.uint32)
            parts.append((block, triangles, ids if self.materials else None))
        if not parts:
            return None
        if self._skinned:
            self._exact[len(self.meshes)] = np.concatenate(self._skinned)
        name, extras = str(entry.get("name", "")), entry.get("extras")
        mesh = join(blocks, parts)
        return replace(mesh, name=name, extras=extras, coordinates=dict(GLTF))

    def _restart(self, primitive: Json, vertices: int) -> int | None:
        """The index that begins another strip or fan: glTF forbids the largest of a type, with
        which graphics cards do so. None where it is a vertex."""
        if "indices" not in primitive:
            return None
        largest = int(np.iinfo(self.buffers.array(primitive["indices"], "indices")[0].dtype).max)
        return largest if largest >= vertices else None

    def _primitive(
        self,
        primitive: Json,
        name: str,
        weights: list[float],
        joints: Float64Array | None,
        first_joint: int,
        shared: dict[str, int],
        blocks: list[Mesh],
    ) -> tuple[int, UInt32Array]:
        """The number of the block of vertices that a primitive uses, made if no earlier primitive
        of the mesh has the same, and its indices."""
        draco = (primitive.get("extensions") or {}).get(_DRACO)
        targets = primitive.get("targets") if any(weights) else None
        key = repr((sorted(primitive["attributes"].items()), targets, draco))
        if draco is not None:
            from umbel.io.gltf.draco import read_draco

            decoded, corners = read_draco(primitive, draco, self.buffers, name)
        else:
            decoded, corners = {}, None
        arrays = {} if key in shared else self._attributes(primitive["attributes"], name, decoded)
        if key not in shared:
            if targets:
                _apply_morph(arrays, targets, weights, self.buffers, name)
            if joints is not None:
                self._skinned.append(_apply_skin(arrays, joints, self.where, name))
            shared[key] = len(blocks)
            blocks.append(_block(arrays, first_joint))
        if corners is None:
            if "indices" in primitive:
                corners = self.buffers.indices(primitive["indices"], name)
            else:
                corners = np.arange(len(blocks[shared[key]].positions), dtype=np.uint32)
        return shared[key], corners

    def _attributes(
        self, attributes: Json, name: str, decoded: dict[str, NDArray[Any]]
    ) -> dict[str, NDArray[Any]]:
        """The attributes of a primitive; `decoded` are those that Draco holds."""
        out = dict(decoded)
        for semantic, accessor in attributes.items():
            if semantic in decoded:
                continue
            user = f"{name}.{semantic}"
            if semantic in _WIDTHS or semantic.startswith(("COLOR_0", "TEXCOORD_", "WEIGHTS_")):
                # Integers of colours are fractions, also in files that do not say so.
                fractions = True if semantic == "COLOR_0" else None
                out[semantic] = self.buffers.floats(accessor, user, fractions)
            elif semantic.startswith("JOINTS_"):
                out[semantic] = self.buffers.array(accessor, user)[0]
        check_attributes(out, self.where, name)
        return out


def check_attributes(arrays: dict[str, NDArray[Any]], where: str, name: str) -> None:
    """Raises unless all attributes have POSITION's count and their own width."""
    count = len(arrays["POSITION"])
    for semantic, array in arrays.items():
        if len(array) != count:
            raise Error(f"{where}: {name} has {count} positions and {len(array)} of {semantic}")
        width = _WIDTHS.get(semantic, _NUMBERED_WIDTHS.get(semantic.partition("_")[0]))
        if (width and array.shape[1] != width) or (
            semantic == "COLOR_0" and array.shape[1] not in (3, 4)
        ):
            raise Error(f"{where}: {name} has {semantic} of {array.shape[1]} components")


def _block(arrays: dict[str, NDArray[Any]], first_joint: int) -> Mesh:
    joints, weights = _skin(arrays, first_joint)
    uvs = _uvs(arrays)
    return Mesh(
        arrays["POSITION"],
        np.zeros((0, 3), np.uint32),
        normals=unit_normals(arrays["NORMAL"]) if "NORMAL" in arrays else None,
        tangents=arrays.get("TANGENT"),
        uvs=uvs[0] if uvs else None,
        colors=arrays.get("COLOR_0"),
        uv_sets=uvs[1:],
        joints=joints,
        weights=weights,
    )


def _numbered(arrays: dict[str, NDArray[Any]], prefix: str, most: int) -> list[NDArray[Any]]:
    """Those of PREFIX_0, PREFIX_1, ... up to the first that is not there."""
    out: list[NDArray[Any]] = []
    while len(out) < most and f"{prefix}_{len(out)}" in arrays:
        out.append(arrays[f"{prefix}_{len(out)}"])
    return out


def _uvs(arrays: dict[str, NDArray[Any]]) -> list[NDArray[Any]]:
    """All sets of texture coordinates, zeros for those before the last that are not there."""
    given = [arrays.get(f"TEXCOORD_{k}") for k in range(1 + MOST_UVS)]
    while given and given[-1] is None:
        given.pop()
    zeros = np.zeros((len(arrays["POSITION"]), 2), np.float32)
    return [zeros if uvs is None else uvs for uvs in given]


def _skin(
    arrays: dict[str, NDArray[Any]], first_joint: int
) -> tuple[UInt32Array | None, Float32Array | None]:
    """Joints and weights of all sets; joints without weight are 0."""
    joints = _numbered(arrays, "JOINTS", _MOST_SKIN_SETS)
    weights = _numbered(arrays, "WEIGHTS", _MOST_SKIN_SETS)
    sets = min(len(joints), len(weights))
    if not sets or any(j.dtype.kind != "u" for j in joints[:sets]):
        return None, None
    weight = np.concatenate(weights[:sets], axis=1)
    joint = np.concatenate(joints[:sets], axis=1).astype(np.uint32) + np.uint32(first_joint)
    return np.where(weight != 0, joint, np.uint32(0)), weight


def _triangulated(corners: UInt32Array, mode: int, restart: int | None) -> UInt32Array:
    if mode == _TRIANGLES:
        whole = len(corners) - len(corners) % 3
        return corners[:whole].reshape(-1, 3)
    if mode == _STRIP:
        return strips(np.array([len(corners)]), corners, restart)
    breaks = np.array([-1, *np.flatnonzero(corners == restart).tolist(), len(corners)])
    polygons, _ = fans(np.diff(breaks) - 1)
    return np.roll(corners[corners != restart][polygons], -1, axis=1)


def _apply_morph(
    arrays: dict[str, NDArray[Any]],
    targets: list[Json],
    weights: list[float],
    buffers: Buffers,
    name: str,
) -> None:
    for k, (target, weight) in enumerate(zip(targets, weights, strict=False)):
        for semantic, accessor in target.items():
            if not weight or semantic not in arrays or not semantic.startswith(_MORPHED):
                continue
            delta = buffers.floats(accessor, f"{name}.targets[{k}].{semantic}")
            moved = arrays[semantic].copy()
            width = 3 if semantic == "TANGENT" else moved.shape[1]
            if semantic == "COLOR_0":  # either may lack alpha
                width = min(width, max(delta.shape[1], 3))
                delta = delta[:, :width]
            if delta.shape != (len(moved), width):
                raise Error(f"{buffers.where}: {name}.targets[{k}] does not fit its primitive")
            moved[:, :width] += np.float32(weight) * delta
            arrays[semantic] = moved


def _apply_skin(
    arrays: dict[str, NDArray[Any]], joints: Float64Array, where: str, name: str
) -> Float64Array:
    """Places vertices as the skin's joints do in the rest pose, and gives their positions as they
    are before rounding."""
    sets = [k for k in range(8) if f"JOINTS_{k}" in arrays and f"WEIGHTS_{k}" in arrays]
    if not sets:
        return arrays["POSITION"].astype(np.float64)
    index = np.concatenate([arrays[f"JOINTS_{k}"] for k in sets], axis=1)
    weight = np.concatenate([arrays[f"WEIGHTS_{k}"] for k in sets], axis=1).astype(np.float64)
    if index.shape != weight.shape or index.dtype.kind != "u":
        raise Error(f"{where}: {name} has joints and weights that do not fit each other")
    if index.size and int(index[weight != 0].max(initial=0)) >= len(joints):
        raise Error(f"{where}: {name} names joint {int(index.max())} of {len(joints)}")
    if (joints == np.eye(4)).all():  # bound in this pose: every bit stays
        return arrays["POSITION"].astype(np.float64)
    index = np.where(weight != 0, index, 0)
    matrix = np.zeros((len(index), 3, 4))
    with np.errstate(all="ignore"):
        for k in range(index.shape[1]):
            matrix += weight[:, k, None, None] * joints[index[:, k], :3]
        total = weight.sum(axis=1)
        matrix[total > 0] /= total[total > 0, None, None]
        matrix[~(total > 0)] = np.eye(4)[:3]
        linear = matrix[:, :, :3]
        points: Float64Array = _applied(linear, arrays["POSITION"]) + matrix[:, :, 3]
        arrays["POSITION"] = points.astype(np.float32)
        determinant = np.sign(np.linalg.det(linear))
        if "NORMAL" in arrays:
            a, b, c = linear[:, 0], linear[:, 1], linear[:, 2]
            cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
            turned = _applied(cofactors, arrays["NORMAL"])
            arrays["NORMAL"] = normalized(turned * np.where(determinant < 0, -1, 1)[:, None])
        if "TANGENT" in arrays:
            tangent = arrays["TANGENT"].copy()
            tangent[:, :3] = normalized(_applied(linear, tangent[:, :3]))
            tangent[determinant < 0, 3] *= -1
            arrays["TANGENT"] = tangent
    return points


def _applied(matrices: Float64Array, vectors: Float32Array) -> Float64Array:
    out: Float64Array = np.einsum("nij,nj->ni", matrices, vectors.astype(np.float64))
    return out


__all__ = ["Material", "check_attributes", "read_gltf"]
