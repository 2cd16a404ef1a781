"""The instances of an asset's meshes, their cuts, and all that is shown as one scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.camera import Camera
from umbel.geometry.mesh import Mesh
from umbel.io.gltf.cameras import tree_cameras
from umbel.io.gltf.tree import check_tree, owners_of, worlds
from umbel.io.scene import Instance, Scene
from umbel.lod.tables import check_budget, check_error, check_level

if TYPE_CHECKING:
    from umbel.lod.asset import Asset

MeshInstance = tuple[int, NDArray[Any]]
"""A mesh, and the (3, 4) matrix from its space to the world."""

_BOX = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
_BOX += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]


@dataclass(frozen=True)
class InstanceCut:
    """A cut of one instance of a mesh."""

    mesh: int
    transform: NDArray[Any]
    cut: NDArray[np.uint32]
    """The clusters' numbers in the mesh's tables, ascending."""
    found: _umbel.FoundCut | None = None
    """Where the clusters are in the file; None: looked up in the tables."""


def all_instances(asset: Asset) -> list[MeshInstance]:
    """All instances; without a list of them, each mesh once where it is."""
    instances = asset.instances
    if instances:
        return instances
    return [(mesh, np.eye(4, dtype=np.float32)[:3]) for mesh in range(len(asset.meshes))]


def instance_boxes(bounds: Sequence[Any], instances: Sequence[MeshInstance]) -> Mesh:
    """The boxes of instances, as a mesh. `bounds` are the meshes' least and greatest corners, or
    None for a mesh without triangles."""
    drawn = [one for one in instances if bounds[one[0]] is not None]
    if not drawn:
        return Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    matrices = np.array([matrix[:3] for _, matrix in drawn], np.float64)
    boxes = np.array([np.zeros((2, 3)) if box is None else box for box in bounds], np.float64)
    low, high = boxes[[mesh for mesh, _ in drawn]].transpose(1, 0, 2)[:, :, None]
    unit = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)])
    with np.errstate(invalid="ignore"):  # what is not finite is refused later
        local = low + unit * (high - low)
        corners = local @ matrices[:, :, :3].transpose(0, 2, 1) + matrices[:, None, :, 3]
    first = 8 * np.arange(len(drawn), dtype=np.uint32)
    faces = np.array(_BOX, np.uint32) + first[:, None, None]
    return Mesh(corners.reshape(-1, 3), faces.reshape(-1, 3))


def asset_boxes(asset: Asset) -> Mesh:
    """The boxes of all instances of an asset, as a mesh."""
    bounds = [mesh["bounds"] for mesh in asset.meshes]
    origin = asset._mesh_origin
    if origin.any():
        bounds = [None if box is None else origin + np.array(box) for box in bounds]
    return instance_boxes(bounds, all_instances(asset))


def local_transforms(asset: Asset) -> NDArray[np.float32]:
    """(i, 3, 4): the matrices of `all_instances`, relative to the asset's origin."""
    rows = asset._native.transforms().reshape(-1, 3, 4)
    if len(rows):
        return rows
    return np.tile(np.eye(4, dtype=np.float32)[:3], (len(asset.meshes), 1, 1))


def scale_range(matrix: NDArray[Any]) -> tuple[float, float]:
    """The smallest and the largest factor by which a matrix scales lengths."""
    least, most = scale_ranges([matrix])[0]
    return float(least), float(most)


def scale_ranges(matrices: Sequence[NDArray[Any]]) -> NDArray[np.float64]:
    """(n, 2): the smallest and the largest factor by which each matrix scales lengths."""
    turns = np.array([matrix[:3, :3] for matrix in matrices], np.float64).reshape(-1, 3, 3)
    factors: NDArray[Any] = np.linalg.svd(turns, compute_uv=False)
    return factors[:, [2, 0]]


def scene_cuts(asset: Asset, *, or_coarsest: bool = False, **how: Any) -> list[InstanceCut]:
    """The cut of every instance. One of error and camera (as in `Tables.cut`, in the scene's
    unit), level, and triangles (most of all cuts together), with `or_coarsest` as there. Reads the
    pages that the cuts need, and no tables."""
    if sum(value is not None for value in how.values()) != 1:
        raise Error("a scene needs exactly one of error, camera, level and triangles")
    if asset.has_instance_tree:
        if how.get("level") is not None or how.get("triangles") is not None:
            raise Error(f"{asset.path} has a tree of instances: choose by error or by camera")
        return _tree_cuts(asset, _scene_view(asset, how.get("error"), how.get("camera")))
    if how.get("level") is not None:
        return _cuts_by_level(asset, how["level"])
    most = None if how.get("triangles") is None else check_budget("triangles", how["triangles"])
    view = _scene_view(asset, how.get("error"), how.get("camera"))
    if most is not None:
        meshes, rows = asset._native.instance_meshes(), asset._native.transforms()
        view = asset._native.view_for_triangles(view, most, meshes, rows.reshape(-1, 12))
    shown = _cuts(asset, view)
    if most is not None and not or_coarsest:
        least = sum(one.found.triangles for one in shown if one.found is not None)
        if least > most:
            raise Error(f"triangles is {most}, but the coarsest cut has {least}")
    return shown


def _scene_view(asset: Asset, error: float | None, camera: Camera | None) -> _umbel.View:
    """Relative to the asset's origin; without either that of the source itself."""
    if camera is not None:
        if not isinstance(camera, Camera):
            raise Error(f"camera must be an umbel.Camera, not a {type(camera).__name__}")
        return camera.relative_to(asset.origin).view()
    if error is None:
        return _umbel.view_error(0)
    check_error(error)
    return _umbel.view_error(error)


def scene_error(asset: Asset, shown: Sequence[InstanceCut]) -> float:
    """The largest error of what is shown, in the scene's unit."""

    def error_of(one: InstanceCut) -> float:
        if one.found is not None:
            return one.found.error
        return asset.mesh_tables(one.mesh).cut_error(one.cut)

    return max((error_of(one) * scale_range(one.transform)[1] for one in shown), default=0.0)


def scene_mesh(asset: Asset, shown: Sequence[InstanceCut]) -> Mesh:
    """What is shown, as one mesh."""
    return shown_scene(asset, shown).flatten()


def shown_scene(asset: Asset, shown: Sequence[InstanceCut]) -> Scene:
    """What is shown, on the nodes that it is from."""
    tree = asset.scene
    check_tree(tree, asset.path)
    notes = tree.pop("meshes", None) or []
    owners = owners_of(tree, len(shown))
    for node in tree.get("nodes", []):
        node.pop("instances", None)
    materials = asset.materials
    name = asset.info["metadata"].get("name", "")
    scene = Scene([], materials, name=name, cameras=tree_cameras(tree), tree=tree)
    every = worlds(tree.get("nodes", []))
    made: dict[tuple[int, bytes], int] = {}
    for one, owner in zip(shown, owners, strict=True):
        key = (one.mesh, one.cut.tobytes())
        if key not in made:
            made[key] = len(scene.meshes)
            mesh = asset._mesh(one.cut, one.mesh, materials, one.found)
            if one.mesh < len(notes) and isinstance(notes[one.mesh], dict):
                mesh.name = str(notes[one.mesh].get("name") or mesh.name)
                mesh.extras = notes[one.mesh].get("extras")
            scene.meshes.append(mesh)
        matrix = np.eye(4)
        matrix[:3] = one.transform
        if owner is not None and _is_rounded(matrix, every[owner], asset.origin):
            matrix = every[owner]
        scene.instances.append(Instance(made[key], matrix, node=owner))
    return scene


def _is_rounded(matrix: NDArray[Any], exact: NDArray[Any], origin: NDArray[Any]) -> bool:
    """Whether a matrix is what an asset, in float32 around its origin, keeps of the exact one."""

    def kept(given: NDArray[Any]) -> NDArray[Any]:
        local = given[:3].copy()
        local[:, 3] -= origin
        return local.astype(np.float32)

    return bool(np.allclose(kept(matrix), kept(exact), rtol=2.0**-22, atol=0.0))


def _cuts(asset: Asset, view: _umbel.View) -> list[InstanceCut]:
    """The cuts that a view of the scene gives."""
    local = local_transforms(asset)
    views = [
        _umbel.view_in_instance(view, row.reshape(1, 12)) if asset.instances else view
        for row in local
    ]
    return _found(asset, views)


def _tree_cuts(asset: Asset, view: _umbel.View) -> list[InstanceCut]:
    """What a view shows of a tree of instances, whole."""
    shown = shown_instances(asset, _umbel.InstanceSelector(asset._native, 1), view)
    matrices: NDArray[Any] = shown.transforms
    if asset.origin.any():
        matrices = matrices.astype(np.float64)
        matrices[:, :, 3] += asset.origin
    views = [shown.views[k] for k in shown.view_of]
    return _found(asset, views, list(zip(shown.meshes.tolist(), matrices, strict=True)))


@dataclass(frozen=True)
class ShownInstances:
    """Instances and the views of their own spaces, which many share."""

    meshes: NDArray[Any]
    transforms: NDArray[Any]
    """(n, 3, 4), relative to the asset's origin."""
    view_of: NDArray[np.int64]
    """(n,): which of `views` each has."""
    views: list[_umbel.View]
    view_meshes: list[int]


def listed_instances(asset: Asset, view: _umbel.View) -> ShownInstances:
    """All instances of an asset that lists them, each with a view of its own."""
    rows = local_transforms(asset)
    views = [_umbel.view_in_instance(view, row.reshape(1, 12)) for row in rows]
    meshes = [mesh for mesh, _ in all_instances(asset)]
    return ShownInstances(np.array(meshes), rows, np.arange(len(rows)), views, meshes)


def shown_instances(
    asset: Asset,
    selector: _umbel.InstanceSelector,
    view: _umbel.View,
    planes: NDArray[np.float32] | None = None,
) -> ShownInstances:
    """What a view shows of a tree of instances, after reading what it needs. Those for which their
    mesh's coarsest clusters will do share one view a mesh."""
    runs = selector.settle(view, planes)[0]
    meshes, rows = selector.placements(runs)
    coarsest = np.repeat(runs[:, 3] != 0, runs[:, 2])
    fine = np.flatnonzero(~coarsest)
    count = len(asset.meshes)
    view_of = meshes.astype(np.int64)
    view_of[fine] = count + np.arange(len(fine))
    views = [_umbel.view_error(float(np.finfo(np.float32).max))] * count
    views += [_umbel.view_in_instance(view, rows[k].reshape(1, 12)) for k in fine]
    view_meshes = [*range(count), *meshes[fine].tolist()]
    return ShownInstances(meshes, rows.reshape(-1, 3, 4), view_of, views, view_meshes)


def instances_of_meshes(asset: Asset) -> NDArray[np.int64]:
    """How many instances each mesh has. Reads all of a tree of instances."""
    count = len(asset.meshes)
    if not asset.has_instance_tree:
        return np.bincount([mesh for mesh, _ in all_instances(asset)], minlength=count)
    total = np.zeros(count, np.int64)
    children = _umbel.instance_nodes(asset._native)["children"].reshape(-1, 2)
    for node in np.flatnonzero(children[:, 1] == 0):
        meshes, _ = _umbel.placements_of_node(asset._native, int(node))
        total += np.bincount(meshes, minlength=count)
    return total


def _cuts_by_level(asset: Asset, level: int) -> list[InstanceCut]:
    """A level of every mesh; the coarsest of one that does not have as many."""
    of_meshes = [mesh["levels"] for mesh in asset.meshes]
    levels = [of_meshes[mesh] for mesh, _ in all_instances(asset)]
    check_level(level, max(levels, default=0))
    return _found(asset, [_umbel.view_level(min(level, max(n - 1, 0))) for n in levels])


def _found(
    asset: Asset, views: Sequence[_umbel.View], instances: list[MeshInstance] | None = None
) -> list[InstanceCut]:
    """The cuts of all instances, each seen with a view of its own space; equal ones are found
    once."""
    known: dict[tuple[Any, ...], tuple[_umbel.FoundCut, NDArray[np.uint32]]] = {}
    shown = []
    instances = all_instances(asset) if instances is None else instances
    for (mesh, matrix), view in zip(instances, views, strict=True):
        key = (mesh, view.kind, view.error, view.threshold, view.level, tuple(view.eye))
        if key not in known:
            found = asset._native.find_cut(view, mesh)
            known[key] = found, found.clusters()
        found, clusters = known[key]
        shown.append(InstanceCut(mesh, matrix, clusters, found))
    return shown
