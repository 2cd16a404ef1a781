"""glTF as tables: triangles of accessors that are neither compressed nor sparse, moved by nodes."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Mesh
from umbel.io.blocks.layout import Column, Extra, Layout
from umbel.io.coordinates import GLTF as COORDINATES
from umbel.io.files import GZIP, read_head
from umbel.io.folder import Folder
from umbel.io.gltf.buffers import Buffers, Json, glb_ranges, is_data_uri, parse_json
from umbel.io.gltf.images import texture_reader
from umbel.io.gltf.losses import idle_images, idle_nodes, losses, missing_textures, unknown_names
from umbel.io.gltf.materials import read_material
from umbel.io.gltf.nodes import Nodes
from umbel.io.gltf.reader import MOST_UVS, check_header
from umbel.io.gltf.schema import check_schema
from umbel.io.gltf.tree import Tree
from umbel.io.scene import NO_MATERIAL, Instance, Scene

__all__ = ["COORDINATES", "lay_out"]

_STREAMS = {
    "POSITION": ("positions", "VEC3"),
    "NORMAL": ("normals", "VEC3"),
    "TANGENT": ("tangents", "VEC4"),
    "TEXCOORD_0": ("uvs", "VEC2"),
    "COLOR_0": ("colors", None),
}
_TYPES = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES = 4
#: Attributes that no asset has: those of applications, and further colours.
_LEFT_OUT = ("_", "COLOR_")
#: How the library numbers further texture coordinates.
_UVS = 4


class _Whole(Exception):
    """Only the reader of whole files can read this."""


def lay_out(layout: Layout, path: Path) -> bool:
    """Adds the file's tables; False if only the reader of whole files can read it."""
    head = read_head(path)
    if head.startswith(GZIP):
        return False
    binary = None
    with path.open("rb") as file:

        def read(at: int, size: int) -> bytes:
            file.seek(at)
            return file.read(size)

        length = path.stat().st_size
        if head[:4] == b"glTF":
            (at, size), binary = glb_ranges(read, length, str(path))
            root = parse_json(read(at, size), str(path))
        else:
            root = parse_json(read(0, length), str(path))
    check_schema(root, str(path))
    check_header(root, str(path))
    try:
        plan = _Plan(root, Folder(path.parent, layout.allow_outside), path, binary)
    except Error:
        raise
    except (_Whole, LookupError, TypeError, ValueError):  # the reader of whole files says more
        return False
    plan.add_to(layout)
    scene = plan.scene()
    warn_of_nodes(scene, path)
    layout.trees.append((path, scene.merged_tree(np.zeros(3))))
    return True


def warn_of_nodes(scene: Scene, path: Path) -> None:
    """Says what gets lost as all becomes one mesh."""
    lost = scene.merge_loss()
    if lost:
        sentence = f"{path}: {lost}; only a build in memory, with instances on, keeps its nodes"
        warnings.warn(sentence, LoadWarning, stacklevel=5)


class _Plan:
    """What would be added: nothing is, until it is known that all can be."""

    def __init__(
        self, root: Json, folder: Folder, path: Path, binary: tuple[int, int] | None
    ) -> None:
        self.root, self.folder, self.path, self.binary = root, folder, path, binary
        self.buffers = Buffers(root, None, str(path), self.folder)
        self.nodes = Nodes(self.buffers)
        #: node, accessors by stream, indices, material
        self.parts: list[tuple[int, dict[str, int], int | None, int]] = []
        streams = set()
        self.drawn = self.nodes.drawn()
        for index in self.drawn:
            node = self.nodes.node(index)
            if "mesh" not in node:
                continue
            if "skin" in node or node.get("extensions"):
                raise _Whole
            mesh = self.buffers.item("meshes", node["mesh"], f"nodes[{index}]")
            if any(node.get("weights", mesh.get("weights")) or ()):
                raise _Whole
            for primitive in mesh.get("primitives") or []:
                streams.add(self._add(index, primitive))
        # Normals and tangents that only some have are made from the whole mesh.
        if not self.parts or len({s & {"NORMAL", "TANGENT"} for s in streams}) > 1:
            raise _Whole
        self.tree = Tree(root, self.nodes, self.drawn)

    def _add(self, node: int, primitive: Json) -> frozenset[str]:
        attributes = primitive.get("attributes") or {}
        further = _further(attributes)
        known_names = {*_STREAMS, *further}
        other = [a for a in attributes if a not in known_names and not a.startswith(_LEFT_OUT)]
        if (
            primitive.get("mode", _TRIANGLES) != _TRIANGLES
            or primitive.get("extensions")
            or other
            or "POSITION" not in attributes
        ):
            raise _Whole
        for semantic, accessor in attributes.items():
            if semantic in known_names:
                self._place(accessor, semantic)
        known = {k: v for k, v in attributes.items() if k in known_names}
        counts = {self._accessor(accessor)["count"] for accessor in known.values()}
        indices = primitive.get("indices")
        if indices is not None:
            self._place(indices, "")
            counts.discard(None)
        count = self._accessor(indices if indices is not None else known["POSITION"])["count"]
        if len(counts) != 1 or count % 3:
            raise _Whole
        material = primitive.get("material")
        if material is not None:
            self.buffers.item("materials", material, "a primitive")
        self.parts.append((node, known, indices, NO_MATERIAL if material is None else material))
        return frozenset(known)

    def _accessor(self, index: Any) -> Json:
        return self.buffers.item("accessors", index, "a primitive")

    def _place(self, index: Any, semantic: str) -> tuple[Path, int, int, int, str, int, bool]:
        """File, first byte, stride, rows, type, width, and whether integers stand for fractions."""
        accessor = self._accessor(index)
        kind, width = _TYPES.get(accessor["componentType"]), _WIDTHS.get(accessor["type"])
        unit = bool(accessor.get("normalized", False)) or semantic == "COLOR_0"
        wanted = _STREAMS.get(semantic, ("", "VEC2"))[1] if semantic else "SCALAR"
        if (
            kind is None
            or width is None
            or accessor.get("bufferView") is None
            or "sparse" in accessor
            or (wanted is not None and accessor["type"] != wanted)
            or (semantic == "COLOR_0" and width not in (3, 4))
            or (semantic == "POSITION" and unit)
            or (not semantic and kind[0] != "u")
        ):
            raise _Whole
        view = self.buffers.item("bufferViews", accessor["bufferView"], "an accessor")
        if view.get("extensions"):
            raise _Whole
        path, at, size = self._buffer(view["buffer"])
        offset, length = view.get("byteOffset", 0), view["byteLength"]
        item = np.dtype(kind).itemsize * width
        stride = view.get("byteStride") or item
        first, rows = accessor.get("byteOffset", 0), accessor["count"]
        last = first + (rows - 1) * stride + item if rows else 0
        if stride < item or last > length or offset + length > size:
            raise _Whole  # which says what is wrong
        return path, at + offset + first, stride, rows, kind, width, unit

    def _buffer(self, index: Any) -> tuple[Path, int, int]:
        """The file that a buffer is in, its first byte there, and its bytes."""
        entry = self.buffers.item("buffers", index, "a view")
        uri, length = entry.get("uri"), entry.get("byteLength", 0)
        if uri is None:
            if self.binary is None or index != 0 or length > self.binary[1]:
                raise _Whole
            return self.path, self.binary[0], length
        if not isinstance(uri, str) or is_data_uri(uri):
            raise _Whole
        path = self.folder.find_uri(uri)
        if read_head(path).startswith(GZIP) or path.stat().st_size < length:
            raise _Whole
        return path, 0, length

    def _view(self, index: int) -> bytes:
        """The bytes of an image that is in a buffer."""
        view = self.buffers.item("bufferViews", index, "an image")
        try:
            path, at, size = self._buffer(view["buffer"])
        except _Whole:  # a buffer that is not a plain file
            return self.buffers.view(index, "an image")[0]
        offset, length = view.get("byteOffset", 0), view["byteLength"]
        if view.get("extensions") or offset + length > size:
            raise Error(f"bufferViews[{index}] of an image is not in its buffer")
        with path.open("rb") as file:
            file.seek(at + offset)
            return file.read(length)

    def scene(self) -> Scene:
        """The scene, of whose meshes there are only names and extras."""
        meshes: dict[int, int] = {}
        instances: list[Instance] = []
        for index in dict.fromkeys(node for node, *_ in self.parts):
            node = self.nodes.node(index)
            mesh = meshes.setdefault(node["mesh"], len(meshes))
            place = self.nodes.world(index), str(node.get("name", "")), self.tree.numbers[index]
            instances.append(Instance(mesh, *place))
        return Scene(
            [_called(self.root["meshes"][number]) for number in meshes],
            instances=instances,
            name=self.path.stem,
            tree=self.tree.json,
        )

    def add_to(self, layout: Layout) -> None:
        lost: list[str] = []
        textures = texture_reader(self.buffers, lost, self._view)
        entries = self.root.get("materials") or []
        numbers = layout.shared.add([read_material(entry, textures.image) for entry in entries])
        lost += losses(self.root, [self.nodes.node(k) for k in self.drawn], self.tree.lost)
        lost += idle_nodes(self.root, len(self.tree.numbers))
        lost += missing_textures(len(textures.missing))
        lost += idle_images(textures.idle)
        lost += unknown_names(self.root)
        if lost:
            warnings.warn(f"{self.path}: left out: {'; '.join(lost)}", LoadWarning, stacklevel=5)
        files: dict[Path, int] = {}
        tables: dict[tuple[int, str], Column] = {}

        def column(accessor: int, semantic: str) -> Column:
            if (accessor, semantic) not in tables:
                path, at, stride, rows, kind, width, unit = self._place(accessor, semantic)
                if path not in files:
                    files[path] = layout.add_file(path)
                offsets = [k * np.dtype(kind).itemsize for k in range(width)]
                if not semantic:  # three indices are a row
                    offsets, stride, rows = [k * stride for k in range(3)], 3 * stride, rows // 3
                table = layout.add_table(files[path], at, stride, rows)
                tables[accessor, semantic] = (table, kind, offsets, unit)
            return tables[accessor, semantic]

        for node, attributes, indices, material in self.parts:
            columns: dict[str, Column] = {}
            extras: list[Extra] = []
            for semantic, accessor in attributes.items():
                found = column(accessor, semantic)
                if semantic in _STREAMS:
                    columns[_STREAMS[semantic][0]] = found
                else:
                    extras.append((_UVS, int(semantic.rpartition("_")[2]), found))
            triangles = 0
            if indices is not None:
                columns["indices"] = column(indices, "")
                triangles = self._accessor(indices)["count"] // 3
            number = NO_MATERIAL if material == NO_MATERIAL else numbers[material]
            layout.add_part(
                str(self.path),
                columns,
                triangles,
                number,
                transform=self.nodes.world(node),
                extras=extras,
            )


def _called(entry: Json) -> Mesh:
    """A mesh that has what the file says of it, and no triangles."""
    none = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)
    return Mesh(*none, name=str(entry.get("name", "")), extras=entry.get("extras"))


def _further(attributes: Json) -> list[str]:
    """The sets of texture coordinates behind the first."""
    found: list[str] = []
    while "TEXCOORD_0" in attributes and f"TEXCOORD_{len(found) + 1}" in attributes:
        found.append(f"TEXCOORD_{len(found) + 1}")
    return found if len(found) <= MOST_UVS else []
