"""What an export reads of an asset: the boxes of a cut's clusters, and what of a cut lies in a box.
Both read the pages that they need and keep none.

All coordinates here are those of tiles: relative to the asset's origin, with z up."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.export.piece import Doubles, Piece
from umbel.geometry.mesh import Material, Mesh
from umbel.io.format_losses import (
    LIGHTS,
    WHERE,
    camera_and_light_losses,
    name_losses,
    reference_losses,
)
from umbel.io.gltf.tree import check_tree
from umbel.io.scene import NO_MATERIAL, join, transformed, with_default
from umbel.lod.asset import Asset
from umbel.lod.instances import all_instances, local_transforms, scale_range

#: From glTF's axes, y up, to those of tiles, z up, as 3D Tiles 1.1 defines it.
Y_TO_Z = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
MOST_INSTANCES = 250_000
"""All of a tree of instances are read."""
_MARGIN = 1e-5
"""How much larger than a box what is read for it is, as planes are floats."""


def axis_up(asset: Asset, up: str | None) -> str:
    """The axis to the zenith: the one asked for, that of the asset's source, or z for maps."""
    if up not in (None, "y", "z"):
        raise Error(f"up must be 'y' or 'z', not {up!r}")
    said = asset.coordinates.get("up")
    if up or said in ("y", "z"):
        return str(up or said)
    return "z" if asset.coordinates.get("crs") or asset.origin.any() else "y"


class Source:
    """An asset in the coordinates of tiles."""

    def __init__(self, asset: Asset, up: str | None = None) -> None:
        self.asset = asset
        check_tree(asset.scene, asset.path)
        if asset.has_instance_tree and asset.instance_count > MOST_INSTANCES:
            raise Error(
                f"{asset.path} has {asset.instance_count:,} instances, more than the "
                f"{MOST_INSTANCES:,} that can be exported for other viewers"
            )
        self.turn = Y_TO_Z if axis_up(asset, up) == "y" else np.eye(3)
        self.materials = asset.materials
        # What has been read:
        self._has_joints = self._has_bright_colors = self._has_missing_materials = False
        #: Of each instance its mesh, and the (3, 4) matrix from that to tiles.
        self.meshes, self._rows = _instances_of(asset)
        self.turned = self.turn @ self._rows.astype(np.float64)
        of_meshes = np.array([mesh["source_triangles"] for mesh in asset.meshes], np.int64)
        #: (n,): of each instance, in the asset's source.
        self.triangles = of_meshes[np.array(self.meshes, np.intp)]
        self._moved = bool(len(asset._native.instance_meshes()))
        #: (n, 6): around each mesh as it is stored, and around each instance.
        self.mesh_boxes = np.array([_box_of(mesh["bounds"]) for mesh in asset.meshes]).reshape(
            -1, 6
        )
        self.boxes = np.array(
            [
                _placed_box(self.mesh_boxes[k], m)
                for k, m in zip(self.meshes, self.turned, strict=True)
            ]
        ).reshape(-1, 6)

    @property
    def origin(self) -> Doubles:
        """(3,): where the tiles' coordinates are zero, in the world with z up."""
        origin: Doubles = self.turn @ self.asset.origin
        return origin

    def bounds(self) -> tuple[Doubles, Doubles]:
        """The least and greatest corner of all levels of all instances."""
        used = self.boxes[(self.boxes[:, :3] <= self.boxes[:, 3:]).all(axis=1)]
        if not len(used):
            raise Error(f"{self.asset.path}: the asset has no triangles to export")
        return used[:, :3].min(axis=0), used[:, 3:].max(axis=0)

    def _view(self, instance: int, error: float) -> _umbel.View:
        view = _umbel.view_error(error)
        return _umbel.view_in_instance(view, self._rows[instance].reshape(1, 12))

    def cluster_boxes(self, error: float) -> Iterator[tuple[Doubles, NDArray[np.uint32]]]:
        """For each instance the (n, 6) boxes of its cut's clusters, and their triangle counts."""
        for k, mesh in enumerate(self.meshes):
            boxes, counts = self.asset._native.cut_boxes(self._view(k, error), mesh)
            yield _moved_boxes(boxes.reshape(-1, 6).astype(np.float64), self.turned[k]), counts

    def error_for(self, triangles: int) -> float:
        """The least error at which all instances have at most so many triangles; that of the
        coarsest cut, where that has more."""
        native = self.asset._native
        meshes, rows = native.instance_meshes(), native.transforms().reshape(-1, 12)
        if self.asset.has_instance_tree:
            meshes, rows = np.array(self.meshes, np.uint32), self._rows.reshape(-1, 12)
        view = native.view_for_triangles(_umbel.view_error(0), triangles, meshes, rows)
        return float(view.error) if np.isfinite(view.error) else self.coarsest_error()

    def coarsest_error(self) -> float:
        """The error of the coarsest cut."""
        errors = [0.0]
        for k, mesh in enumerate(self.meshes):
            found = self.asset._native.find_cut(self._view(k, np.inf), mesh)
            errors.append(found.error * scale_range(self.turned[k])[1])
        return max(errors)

    def find(self, instance: int, error: float) -> _umbel.FoundCut:
        """The cut of an instance at an error."""
        view = self._view(instance, error)
        return self.asset._native.find_cut(view, self.meshes[instance])

    def piece(self, mesh: int, found: _umbel.FoundCut) -> Piece:
        """A cut that was found, whole, in the space of its mesh."""
        made = self._read(mesh, found)
        _, made.material_ids = with_default(self.materials, made.material_ids)
        return Piece.of(made)

    def _read(self, mesh: int, found: _umbel.FoundCut) -> Mesh:
        made = self.asset._mesh([], mesh, self.materials, found)
        # Only ever set, as threads read pieces at once.
        if made.joints is not None:
            self._has_joints = True
        if made.colors is not None and not ((made.colors >= 0) & (made.colors <= 1)).all():
            self._has_bright_colors = True
        ids = made.material_ids
        if ids is not None:
            is_missing = (ids >= len(self.materials)) & (ids != NO_MATERIAL)
            if is_missing.any():
                self._has_missing_materials = True
            made.material_ids = np.where(is_missing, np.uint32(NO_MATERIAL), ids)
        made.origin = np.zeros(3)
        return made

    def cut(
        self, error: float, low: Doubles, high: Doubles, without: NDArray[np.bool_]
    ) -> Piece | None:
        """The cut at an error: all clusters that are in a box at least in part, or nothing. Leaves
        out the instances that are marked, (i,)."""
        pad = _MARGIN * (np.abs(np.concatenate([low, high])).max() + (high - low).max())
        low, high = low - pad, high + pad
        planes = np.zeros((6, 4))
        planes[:3, :3], planes[3:, :3] = np.eye(3), -np.eye(3)
        planes[:3, 3], planes[3:, 3] = -low, high
        touching = ((self.boxes[:, :3] <= high) & (self.boxes[:, 3:] >= low)).all(axis=1)
        return self._joined(error, np.flatnonzero(touching & ~without), planes)

    def whole(self, error: float, instances: NDArray[np.intp]) -> Piece | None:
        """The cut at an error of all of some instances, or nothing."""
        return self._joined(error, instances, None)

    def _joined(
        self, error: float, instances: NDArray[np.intp], planes: Doubles | None
    ) -> Piece | None:
        blocks = []
        for k in instances.tolist():
            own = None if planes is None else _planes_in(planes, self.turned[k])
            found = self.asset._native.find_cut(self._view(k, error), self.meshes[k], own)
            if found.triangles:
                made = self._read(self.meshes[k], found)
                matrix = np.eye(4)
                matrix[:3] = self._rows[k]
                blocks.append(transformed(made, matrix) if self._moved else made)
        if not blocks:
            return None
        mesh = join(blocks, [(k, m.triangles, m.material_ids) for k, m in enumerate(blocks)])
        _, mesh.material_ids = with_default(self.materials, mesh.material_ids)
        return Piece.of(mesh).turned(self.turn)

    def losses(self, path: Path) -> list[str]:
        """What of the asset the export at `path` does not hold, in words; of vertices, when all
        has been read."""
        tree = self.asset.scene
        nodes = tree.get("nodes", [])
        lost = ["joints and weights"] if self._has_joints else []
        if self._has_bright_colors:
            lost.append("colours outside 0 to 1, which become 0 or 1")
        if self._has_missing_materials:
            lost.append("numbers of materials that are not there")
        if any(set(node) - WHERE for node in nodes):
            lost.append("names, extras and extensions of nodes")
        lost += camera_and_light_losses(tree)
        lost += sorted(set(tree.get("extensions", {})) - {LIGHTS})
        held = [tree, *tree.get("scenes", []), *tree.get("meshes", [])]
        if any("extras" in entry for entry in held):
            lost.append("extras of the scene and its meshes")
        lost += name_losses(tree)
        lost += reference_losses(path, self.asset.coordinates)
        return lost


def material_list(source: Source) -> list[Material]:
    """The asset's materials, and one more for triangles without any."""
    return [*source.materials, Material(name="default", metallic=1.0)]


def source_name(asset: Asset) -> str:
    """What the asset calls itself."""
    return str(asset.info["metadata"].get("name") or Path(asset.path).stem)


def copyright_of(asset: Asset) -> dict[str, Any]:
    """glTF's `asset` of the source, without what is of its file alone."""
    said = asset.scene.get("asset", {})
    return {k: said[k] for k in ("copyright", "extras") if k in said and json.dumps(said[k])}


def _instances_of(asset: Asset) -> tuple[list[int], NDArray[np.float32]]:
    """The meshes and (n, 3, 4) local transforms of all instances, also of those in a tree."""
    if not asset.has_instance_tree:
        return [mesh for mesh, _ in all_instances(asset)], local_transforms(asset)
    children = _umbel.instance_nodes(asset._native)["children"].reshape(-1, 2)
    leaves = np.flatnonzero(children[:, 1] == 0).tolist()
    found = [_umbel.placements_of_node(asset._native, leaf) for leaf in leaves]
    meshes: list[int] = np.concatenate([meshes for meshes, _ in found]).tolist()
    return meshes, np.concatenate([rows.reshape(-1, 3, 4) for _, rows in found])


def _box_of(bounds: Any) -> Doubles:
    if bounds is None:
        return np.array([np.inf] * 3 + [-np.inf] * 3)
    return np.array(bounds, np.float64).reshape(6)


def _placed_box(box: Doubles, matrix: Doubles) -> Doubles:
    return box if box[0] > box[3] else _moved_boxes(box[None], matrix)[0]


def _moved_boxes(boxes: Doubles, matrix: Doubles) -> Doubles:
    """The boxes around boxes that a (3, 4) matrix moves."""
    linear, shift = matrix[:, :3], matrix[:, 3]
    centers = (boxes[:, :3] + boxes[:, 3:]) / 2 @ linear.T + shift
    halves = (boxes[:, 3:] - boxes[:, :3]) / 2 @ np.abs(linear).T
    return np.concatenate([centers - halves, centers + halves], axis=1)


def _planes_in(planes: Doubles, matrix: Doubles) -> NDArray[np.float32]:
    """The planes in the space that a (3, 4) matrix takes to theirs, but for those beside which a
    matrix that flattens things puts all alike."""
    own = np.empty_like(planes)
    own[:, :3] = planes[:, :3] @ matrix[:, :3]
    own[:, 3] = planes[:, 3] + planes[:, :3] @ matrix[:, 3]
    length = np.linalg.norm(own[:, :3], axis=1, keepdims=True)
    kept = length[:, 0] > 0
    return np.ascontiguousarray(own[kept] / length[kept], np.float32)
