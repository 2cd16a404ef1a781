"""Building assets of whole scenes: several meshes, each with its levels of detail, and the places
where they stand."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.arrays import as_mesh, native
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import relative_transform
from umbel.geometry.repair import Progress, grid_step
from umbel.io import load_scene
from umbel.io.scene import Scene, placed, scene_of, with_default
from umbel.lod.instances import boxes, stretch
from umbel.lod.lod import PAGE_BYTES, Lod, build_lod, metadata_of, save_asset

MODES = ("auto", "on", "off")
_REPEATED = 2.0
"""How many times the triangles that a scene stores it must draw to be kept as instances."""
_FLAT = 1e-6
"""A place that squeezes its mesh by more, beside how it stretches it, cannot be inverted."""


class SceneLod:
    """Meshes with their levels of detail and where they stand. `build_scene` makes it."""

    def __init__(
        self, lods: list[Lod], scene: Scene, source: dict[str, Any], step: float | None
    ) -> None:
        self.lods = lods
        self.origin = scene.meshes[0].origin if _is_plain(scene) else _origin(scene)
        """Where an asset of it lies in the world."""
        self.coordinates = scene.meshes[0].coordinates
        """See `Mesh.coordinates`."""
        #: (index into `lods`, (4, 4) matrix); none: a single mesh, where it is
        self.instances = [] if _is_plain(scene) else _places(scene)
        self.source = source
        """What it was built from."""
        self.config = lods[0].config if step is None else lods[0].config | {"position_step": step}
        """The settings that it was built with."""
        places = None if _is_plain(scene) else _places(scene)
        moved = [] if places is None else _moved(scene, self.origin)
        self.report = lods[0].report if places is None else _report(lods, places, step, moved)
        """What was built, of all meshes together: as `Lod.report`, but `input_triangles` and
        `input_vertices` count each mesh as often as it stands somewhere, `stored_triangles` once,
        and lengths are in the scene's unit."""
        self._name = scene.name
        self._tree = scene.stored_tree()

    def __repr__(self) -> str:
        return f"<SceneLod: {len(self.lods)} meshes in {max(len(self.instances), 1)} places>"

    def metadata(self) -> dict[str, Any]:
        """What `save` writes beside the geometry."""
        return metadata_of(self, self._name)

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        exact: bool | None = None,
        textures: str = "embed",
        page_bytes: int = PAGE_BYTES,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> int:
        """Writes the asset, as `Lod.save` does. Returns its bytes."""
        return save_asset(
            path,
            self.lods,
            self.instances,
            metadata=self.metadata(),
            exact=exact,
            textures=textures,
            page_bytes=page_bytes,
            origin=self.origin,
            scene=self._tree,
            progress=progress,
            threads=threads,
        )


def arranged(scene: Any, instances: str = "auto", allow_outside: bool = False) -> Scene:
    """A scene (a Scene, a path, or a mesh) as `build_scene` builds it: with one mesh, all that it
    draws, or with those of its meshes that have triangles, each in some places.

    instances: "on" keeps meshes and places apart, "off" makes one mesh, and "auto" keeps them
        apart if more than twice the triangles are drawn that are stored.
    """
    if instances not in MODES:
        raise Error(f"instances must be one of {', '.join(MODES)}, not {instances!r}")
    if isinstance(scene, (str, os.PathLike)):
        scene = load_scene(scene, allow_outside=allow_outside)
    if not isinstance(scene, Scene):
        return scene_of(as_mesh(scene))
    drawn = [len(scene.meshes[place.mesh].triangles) for place in scene.instances]
    used = {p.mesh for p, count in zip(scene.instances, drawn, strict=True) if count}
    stored = sum(len(scene.meshes[mesh].triangles) for mesh in used)
    repeats = instances == "on" or (instances == "auto" and sum(drawn) > _REPEATED * stored)
    if stored and repeats:
        return _apart(scene)
    lost = scene.merge_loss() if instances == "auto" else ""
    if lost:
        sentence = f"{scene.name}: {lost}; --instances on keeps its nodes"
        warnings.warn(sentence, LoadWarning, stacklevel=3)
    return scene_of(scene.flatten())


def build_scene(
    scene: Any,
    *,
    instances: str = "auto",
    precision: str | float | None = None,
    allow_outside: bool = False,
    force: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> SceneLod:
    """Builds the levels of detail of a scene: a `umbel.io.Scene`, a path, or anything that
    `build_lod` takes.

    instances: as `arranged` has it.
    precision: of the scene as it is drawn: each mesh gets the grid that is fine enough wherever it
        stands. Bits count over the longest side of the box around the boxes of all places.
    allow_outside: of a path, as `umbel.load` has it.
    force: build even where over 1 % of a mesh's triangles lose their area: see `build_lod`.
    The rest is as `build_lod` has it, for each mesh.
    """
    whole = arranged(scene, instances, allow_outside)
    is_apart = precision is not None and not _is_plain(whole)
    step = _step(whole, precision) if is_apart else None
    weights = np.array([len(mesh.triangles) for mesh in whole.meshes], np.float64)
    ends = np.cumsum(weights) / max(weights.sum(), 1)
    lods = []
    for k, mesh in enumerate(whole.meshes):
        own = precision if step is None else step / _stretch(whole, k)
        part = _part(progress, 0.0 if k == 0 else float(ends[k - 1]), float(ends[k]))
        lods.append(build_lod(mesh, precision=own, force=force, progress=part, **options))
    places = [whole.meshes[place.mesh] for place in whole.instances]
    source: dict[str, Any] = {
        "triangles": sum(len(mesh.triangles) for mesh in places),
        "vertices": sum(len(mesh.positions) for mesh in places),
    }
    if isinstance(scene, (str, os.PathLike)):
        source["file"] = os.path.basename(scene)
    return SceneLod(lods, whole, source, step)


def _is_plain(scene: Scene) -> bool:
    """Whether the scene is a single mesh, where it is."""
    places = scene.instances
    return len(places) == 1 and np.array_equal(places[0].transform, np.eye(4))


def _apart(scene: Scene) -> Scene:
    """The meshes that are drawn, and their places. What a place makes flat has no way back from
    the world to the mesh: such a place gets a mesh of its own, made flat already."""
    apart = Scene(name=scene.name, cameras=scene.cameras, tree=scene.tree)
    kept: dict[int, int] = {}
    every = [mesh.material_ids for mesh in scene.meshes if mesh.material_ids is not None]
    apart.materials, _ = with_default(scene.materials, np.concatenate(every) if every else None)
    for place in scene.instances:
        mesh = scene.meshes[place.mesh]
        if not len(mesh.triangles):
            continue
        _, ids = with_default(scene.materials, mesh.material_ids)
        mesh = replace(mesh, material_ids=ids, materials=apart.materials)
        if not np.isfinite(place.transform).all():
            raise Error(f"the place {place.name!r} has a matrix that is not finite")
        least, most = stretch(place.transform)
        if not least > _FLAT * most:
            instance = replace(place, mesh=len(apart.meshes), transform=np.eye(4))
            apart.instances.append(instance)
            apart.meshes.append(placed(mesh, place.transform))
            continue
        if place.mesh not in kept:
            kept[place.mesh] = len(apart.meshes)
            apart.meshes.append(mesh)
        apart.instances.append(replace(place, mesh=kept[place.mesh]))
    return apart


def _places(scene: Scene) -> list[tuple[int, Any]]:
    return [(place.mesh, place.transform) for place in scene.instances]


def _stretch(scene: Scene, mesh: int) -> float:
    return max(stretch(place.transform)[1] for place in scene.instances if place.mesh == mesh)


def _step(scene: Scene, precision: Any) -> float:
    """The grid's step in the scene."""
    return grid_step(_boxes(scene), precision)


def _boxes(scene: Scene) -> Mesh:
    """The boxes of all meshes where they stand."""
    bounds = [_umbel.bounds(native(mesh)) for mesh in scene.meshes]
    in_world = [
        None if box is None else mesh.origin + np.array(box)
        for mesh, box in zip(scene.meshes, bounds, strict=True)
    ]
    return boxes(in_world, _places(scene))


def _origin(scene: Scene) -> NDArray[np.float64]:
    """That of everything that stands in the scene."""
    return _boxes(scene).origin


def _moved(scene: Scene, origin: NDArray[np.float64]) -> list[float]:
    """How far float32 matrices, as assets have them, move each mesh where it stands, at most."""
    moved = []
    for place in scene.instances:
        mesh = scene.meshes[place.mesh]
        box = _umbel.bounds(native(mesh))
        exact = relative_transform(place.transform, mesh.origin, origin)
        with np.errstate(over="ignore", invalid="ignore"):
            off = np.abs(exact.astype(np.float32) - exact)
        reach = np.abs(np.array(box)).max(axis=0) if box else np.zeros(3)
        moved.append(float(np.linalg.norm(off[:, :3] @ reach + off[:, 3])))
    return moved


def _part(progress: Progress | None, begin: float, end: float) -> Progress | None:
    if progress is None:
        return None
    return lambda fraction, stage: progress(begin + (end - begin) * fraction, stage)


def _summed(counts: Sequence[dict[str, int]]) -> dict[str, int]:
    return {
        name: sum(one.get(name, 0) for one in counts)
        for name in dict.fromkeys(name for one in counts for name in one)
    }


def _report(
    lods: Sequence[Lod],
    places: Sequence[tuple[int, Any]],
    step: float | None,
    moved: Sequence[float],
) -> dict[str, Any]:
    reports = [lod.report for lod in lods]
    sums = [
        *("degenerate_triangles", "dropped_triangles", "seconds"),
        *("root_groups", "root_triangles", "stuck_groups"),
    ]
    report: dict[str, Any] = {
        "input_triangles": sum(reports[mesh]["input_triangles"] for mesh, _ in places),
        "input_vertices": sum(reports[mesh]["input_vertices"] for mesh, _ in places),
        "stored_triangles": sum(one["input_triangles"] for one in reports),
        **{key: sum(one[key] for one in reports) for key in sums},
        "groups_by_rung": {
            rung: sum(one["groups_by_rung"][rung] for one in reports)
            for rung in reports[0]["groups_by_rung"]
        },
        "groups_by_reason": {
            rung: _summed([one["groups_by_reason"][rung] for one in reports])
            for rung in reports[0]["groups_by_reason"]
        },
        "waits_by_reason": _summed([one["waits_by_reason"] for one in reports]),
        "largest_move": max(
            reports[mesh]["largest_move"] * stretch(matrix)[1] + by
            for (mesh, matrix), by in zip(places, moved, strict=True)
        ),
    }
    if step is not None:
        report["grid_step"] = step
    measured = [one for one in reports if "measured_groups" in one]
    if measured:
        counts = [one["measured_groups"] for one in measured]
        logs = [math.log2(one["mean_overestimate"]) for one in measured]
        report["measured_groups"] = sum(counts)
        report["underestimated_groups"] = sum(one["underestimated_groups"] for one in measured)
        report["mean_overestimate"] = float(2.0 ** np.average(logs, weights=counts))
    return report
