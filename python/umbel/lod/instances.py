"""The instances of an asset's meshes, their cuts, and all that is shown as one scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.geometry.mesh import Mesh
from umbel.io.gltf.cameras import tree_cameras
from umbel.io.gltf.tree import check_tree, owners_of, worlds
from umbel.io.scene import Instance, Scene
from umbel.lod.tables import Tables, check_budget, check_level

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


def all_instances(asset: Asset) -> list[MeshInstance]:
    """All instances; without a list of them, each mesh once where it is."""
    instances = asset.instances
    if instances:
        return instances
    return [(mesh, np.eye(4, dtype=np.float32)[:3]) for mesh in range(len(asset.meshes))]


def instance_boxes(bounds: Sequence[Any], instances: Sequence[MeshInstance]) -> Mesh:
    """The boxes of instances, as a mesh. `bounds` are the meshes' least and greatest corners, or
    None for a mesh without triangles."""
    corners = []
    for mesh, matrix in instances:
        if bounds[mesh] is None:
            continue
        low, high = np.array(bounds[mesh], np.float64)
        unit = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)])
        with np.errstate(invalid="ignore"):  # what is not finite is refused later
            corners.append((low + unit * (high - low)) @ matrix[:3, :3].T + matrix[:3, 3])
    if not corners:
        return Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    faces = np.concatenate([np.array(_BOX, np.uint32) + 8 * k for k in range(len(corners))])
    return Mesh(np.concatenate(corners), faces)


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
    factors = np.linalg.svd(np.asarray(matrix, np.float64)[:3, :3], compute_uv=False)
    return float(factors[-1]), float(factors[0])


def scene_cuts(asset: Asset, *, or_coarsest: bool = False, **how: Any) -> list[InstanceCut]:
    """The cut of every instance. One of error and camera (as in `Tables.cut`, in the scene's
    unit), level, and triangles (most of all cuts together), with `or_coarsest` as there."""
    if sum(value is not None for value in how.values()) != 1:
        raise Error("a scene needs exactly one of error, camera, level and triangles")
    instances = all_instances(asset)
    if len(instances) == 1 and not asset.instances:
        return [InstanceCut(0, instances[0][1], asset.cut(**how, or_coarsest=or_coarsest))]
    if how.get("level") is not None:
        return _cuts_by_level(asset, instances, how["level"])
    if how.get("triangles") is None:
        if how.get("camera") is not None:
            how = how | {"camera": how["camera"].relative_to(asset.origin)}
        return _cuts(asset, instances, lambda tables: tables.view(**how))
    most = check_budget("triangles", how["triangles"])
    errors = _errors(asset, instances)
    low, high = 0, len(errors) - 1  # the last is enough, or nothing is
    while low < high:
        middle = (low + high) // 2
        if _triangles(asset, _cuts_by_error(asset, instances, errors[middle])) <= most:
            high = middle
        else:
            low = middle + 1
    shown = _cuts_by_error(asset, instances, errors[low])
    least = _triangles(asset, shown)
    if least > most and not or_coarsest:
        raise Error(f"triangles is {most}, but the coarsest cut has {least}")
    return shown


def scene_error(asset: Asset, shown: Sequence[InstanceCut]) -> float:
    """The largest error of what is shown, in the scene's unit."""
    return max(
        (
            asset.mesh_tables(one.mesh).cut_error(one.cut) * scale_range(one.transform)[1]
            for one in shown
        ),
        default=0.0,
    )


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
            mesh = asset._mesh(one.cut, one.mesh, materials)
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


def _cuts(
    asset: Asset, instances: Sequence[MeshInstance], view: Callable[[Tables], Any]
) -> list[InstanceCut]:
    shown: dict[int, InstanceCut] = {}
    local = local_transforms(asset)
    for mesh in {mesh for mesh, _ in instances}:
        tables = Tables(asset.mesh_tables(mesh)._native)  # relative to the asset's origin
        mine = [k for k, (m, _) in enumerate(instances) if m == mesh]
        cuts = tables.instance_cuts(local[mine], view(tables))
        for k, cut in zip(mine, cuts, strict=True):
            shown[k] = InstanceCut(mesh, instances[k][1], cut)
    return [shown[k] for k in range(len(instances))]


def _cuts_by_level(
    asset: Asset, instances: Sequence[MeshInstance], level: int
) -> list[InstanceCut]:
    """A level of every mesh; the coarsest of one that does not have as many."""
    tables = {mesh: asset.mesh_tables(mesh) for mesh, _ in instances}
    check_level(level, max((len(one.levels) for one in tables.values()), default=0))
    return [
        InstanceCut(
            mesh, matrix, tables[mesh].cut(level=min(level, max(len(tables[mesh].levels) - 1, 0)))
        )
        for mesh, matrix in instances
    ]


def _cuts_by_error(
    asset: Asset, instances: Sequence[MeshInstance], error: float
) -> list[InstanceCut]:
    return _cuts(asset, instances, lambda tables: tables.view(error=error))


def _triangles(asset: Asset, shown: Sequence[InstanceCut]) -> int:
    return sum(asset.mesh_tables(one.mesh).cut_triangles(one.cut) for one in shown)


def _errors(asset: Asset, instances: Sequence[MeshInstance]) -> NDArray[np.float64]:
    """All errors in the scene's unit at which a cut changes, and 0."""
    found = [np.zeros(1)]
    for mesh, matrix in instances:
        errors = asset.mesh_tables(mesh).groups["error"].astype(np.float64)
        # A little more, so that rounding does not keep what is exactly so large.
        factor = scale_range(matrix)[1] * (1 + 2.0**-20)
        found.append(np.unique(errors[np.isfinite(errors)]) * factor)
    return np.unique(np.concatenate(found))
