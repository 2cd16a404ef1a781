"""A scene as it is built: one mesh of all that is drawn, or its meshes and their instances."""

from __future__ import annotations

import os
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.arrays import as_mesh, native
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import relative_transform
from umbel.io import load_scene
from umbel.io.scene import Scene, scene_of, transformed_far, with_default
from umbel.lod.instances import instance_boxes, scale_ranges

MODES = ("auto", "on", "off")
_REPEATED = 2.0
"""A scene is kept as instances if it draws more than this many times the triangles it stores."""
_FLAT = 1e-6
"""An instance cannot be inverted if its least scale is smaller than this share of its largest."""


def arrange(scene: Any, instances: str = "auto", allow_outside: bool = False) -> Scene:
    """A scene (a Scene, a path, or a mesh) as `build_scene` builds it: all that it draws as one
    mesh, or the meshes that have triangles, with their instances.

    instances: "on" keeps meshes and instances apart, "off" makes one mesh, and "auto" keeps them
        apart if more than twice the triangles are drawn that are stored.
    """
    if instances not in MODES:
        raise Error(f"instances must be one of {', '.join(MODES)}, not {instances!r}")
    if isinstance(scene, (str, os.PathLike)):
        scene = load_scene(scene, allow_outside=allow_outside)
    if not isinstance(scene, Scene):
        return scene_of(as_mesh(scene))
    drawn = [len(scene.meshes[instance.mesh].triangles) for instance in scene.instances]
    used = {i.mesh for i, count in zip(scene.instances, drawn, strict=True) if count}
    stored = sum(len(scene.meshes[mesh].triangles) for mesh in used)
    repeats = instances == "on" or (instances == "auto" and sum(drawn) > _REPEATED * stored)
    if stored and repeats:
        return _keep_instances(scene)
    lost = scene.merge_loss() if instances == "auto" else ""
    if lost:
        sentence = f"{scene.name}: {lost}; instances='on' keeps its nodes"
        warnings.warn(sentence, LoadWarning, stacklevel=3)
    return scene_of(scene.flatten())


def is_single(scene: Scene) -> bool:
    """Whether the scene is a single mesh that nothing moves."""
    instances = scene.instances
    return len(instances) == 1 and np.array_equal(instances[0].transform, np.eye(4))


def mesh_instances(scene: Scene) -> list[tuple[int, Any]]:
    """(mesh, matrix) of each instance."""
    return [(instance.mesh, instance.transform) for instance in scene.instances]


def largest_scale(scene: Scene, mesh: int) -> float:
    """The largest scale of a mesh's instances."""
    matrices = [instance.transform for instance in scene.instances if instance.mesh == mesh]
    return float(scale_ranges(matrices)[:, 1].max())


def scene_boxes(scene: Scene) -> Mesh:
    """The boxes of all instances, as a mesh."""
    bounds = [_umbel.bounds(native(mesh)) for mesh in scene.meshes]
    in_world = [
        None if box is None else mesh.origin + np.array(box)
        for mesh, box in zip(scene.meshes, bounds, strict=True)
    ]
    return instance_boxes(in_world, mesh_instances(scene))


def matrix_rounding(scene: Scene, origin: NDArray[np.float64]) -> list[float]:
    """For each instance, how far its matrix in float32, as assets store it, moves a vertex."""
    boxes = [_umbel.bounds(native(mesh)) for mesh in scene.meshes]
    largest = np.array([np.zeros(3) if box is None else np.abs(box).max(axis=0) for box in boxes])
    exact = np.array(
        [
            relative_transform(one.transform, scene.meshes[one.mesh].origin, origin)
            for one in scene.instances
        ]
    ).reshape(-1, 3, 4)
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(exact.astype(np.float32) - exact)
    of_each = largest[[one.mesh for one in scene.instances]]
    by = (off[:, :, :3] @ of_each[:, :, None])[:, :, 0] + off[:, :, 3]
    return [float(length) for length in np.linalg.norm(by, axis=1)]


def _keep_instances(scene: Scene) -> Scene:
    """The meshes that are drawn, and their instances. An instance whose matrix flattens its mesh
    cannot be inverted for selection, so it gets a mesh of its own that is flat already."""
    apart = Scene(name=scene.name, cameras=scene.cameras, tree=scene.tree)
    kept: dict[int, int] = {}
    every = [mesh.material_ids for mesh in scene.meshes if mesh.material_ids is not None]
    apart.materials, _ = with_default(scene.materials, np.concatenate(every) if every else None)
    meshes: dict[int, Mesh] = {}
    for k, mesh in enumerate(scene.meshes):
        if len(mesh.triangles):
            _, ids = with_default(scene.materials, mesh.material_ids)
            meshes[k] = replace(mesh, material_ids=ids, materials=apart.materials)
    drawn = [instance for instance in scene.instances if instance.mesh in meshes]
    for instance in drawn:
        if not np.isfinite(instance.transform).all():
            raise Error(f"the instance {instance.name!r} has a matrix that is not finite")
    scales = scale_ranges([instance.transform for instance in drawn])
    for instance, (least, most) in zip(drawn, scales, strict=True):
        mesh = meshes[instance.mesh]
        if not least > _FLAT * most:
            apart.instances.append(replace(instance, mesh=len(apart.meshes), transform=np.eye(4)))
            apart.meshes.append(transformed_far(mesh, instance.transform))
            continue
        if instance.mesh not in kept:
            kept[instance.mesh] = len(apart.meshes)
            apart.meshes.append(mesh)
        apart.instances.append(replace(instance, mesh=kept[instance.mesh]))
    return apart
