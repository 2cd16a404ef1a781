"""Building the levels of detail of a scene: one mesh, or several with their instances."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from umbel.geometry.repair import Progress, grid_step
from umbel.io.scene import Scene
from umbel.lod.arrange import arrange, is_single, largest_scale, scene_boxes
from umbel.lod.build import build_lod
from umbel.lod.scene_lod import SceneLod


def build_scene(
    scene: Any,
    *,
    instances: str = "auto",
    allow_outside: bool = False,
    **settings: Any,
) -> SceneLod:
    """Builds the levels of detail of a scene: a `umbel.io.Scene`, a path, or anything that
    `build_lod` takes.

    instances: "on" keeps meshes and instances apart, "off" makes one mesh, and "auto" keeps them
        apart if more than twice the triangles are drawn that are stored.
    allow_outside: of a path, as `umbel.load` has it.
    The settings are those of `build_lod`, for each mesh; but `precision` is that of the scene as it
    is drawn: each mesh gets the grid that is fine enough for all its instances, and bits count over
    the longest side of the box around all instances.
    """
    built = build_arranged(arrange(scene, instances, allow_outside), **settings)
    if isinstance(scene, (str, os.PathLike)):
        built.source["file"] = os.path.basename(scene)
    return built


def build_arranged(
    scene: Scene,
    *,
    precision: str | float | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> SceneLod:
    """The same of a scene as `arrange` gives it: a DAG for each of its meshes."""
    step = None
    if precision is not None and not is_single(scene):
        step = grid_step(scene_boxes(scene), precision)
    counts = np.array([len(mesh.triangles) for mesh in scene.meshes], np.float64)
    ends = np.cumsum(counts) / max(counts.sum(), 1)
    lods = []
    for k, mesh in enumerate(scene.meshes):
        own = precision if step is None else step / largest_scale(scene, k)
        part = _part(progress, 0.0 if k == 0 else float(ends[k - 1]), float(ends[k]))
        lods.append(build_lod(mesh, precision=own, progress=part, **settings))
    return SceneLod(lods, scene, step)


def _part(progress: Progress | None, begin: float, end: float) -> Progress | None:
    if progress is None:
        return None
    return lambda fraction, stage: progress(begin + (end - begin) * fraction, stage)
