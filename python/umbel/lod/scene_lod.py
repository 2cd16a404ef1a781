"""A scene's meshes with their levels of detail and instances, in memory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from umbel.geometry.origin import origin_of
from umbel.io.scene import Scene
from umbel.lod.arrange import is_single, matrix_rounding, mesh_instances, scene_boxes
from umbel.lod.instances import scale_ranges
from umbel.lod.lod import Lod
from umbel.lod.save import Savable


class SceneLod(Savable):
    """Meshes with their levels of detail and instances. `build_scene` makes it."""

    def __init__(self, lods: list[Lod], scene: Scene, step: float | None = None) -> None:
        """`step`: that of the scene's grid, where it has one of its own."""
        single = is_single(scene)
        self.lods = lods
        self.origin = origin_of((scene.meshes[0] if single else scene_boxes(scene)).origin)
        """The origin of an asset of it, in world coordinates."""
        self.coordinates = scene.meshes[0].coordinates
        """See `Mesh.coordinates`."""
        #: (index into `lods`, (4, 4) matrix); none: a single mesh that nothing moves
        self.instances = [] if single else mesh_instances(scene)
        drawn = [scene.meshes[instance.mesh] for instance in scene.instances]
        self.source: dict[str, Any] = {
            "triangles": sum(len(mesh.triangles) for mesh in drawn),
            "vertices": sum(len(mesh.positions) for mesh in drawn),
        }
        """What it was built from."""
        self.config = lods[0].config if step is None else lods[0].config | {"position_step": step}
        """The settings that it was built with."""
        self.report = lods[0].report
        """What was built, of all meshes together: as `Lod.report`, but `input_triangles` and
        `input_vertices` count each mesh once per instance, `stored_triangles` once, and lengths are
        in the scene's unit."""
        if not single:
            moved = matrix_rounding(scene, self.origin)
            self.report = _report(lods, self.instances, step, moved)
        self._name = scene.name
        self._tree = scene.stored_tree()

    def __repr__(self) -> str:
        return f"<SceneLod: {len(self.lods)} meshes in {max(len(self.instances), 1)} instances>"

    def _saved(self) -> dict[str, Any]:
        return {"lods": self.lods, "instances": self.instances or None, "scene": self._tree}


def _summed(counts: Sequence[dict[str, int]]) -> dict[str, int]:
    return {
        name: sum(one.get(name, 0) for one in counts)
        for name in dict.fromkeys(name for one in counts for name in one)
    }


def _report(
    lods: Sequence[Lod],
    instances: Sequence[tuple[int, Any]],
    step: float | None,
    moved: Sequence[float],
) -> dict[str, Any]:
    reports = [lod.report for lod in lods]
    own = np.array([reports[mesh]["largest_move"] for mesh, _ in instances])
    scales = scale_ranges([matrix for _, matrix in instances])
    sums = [
        *("degenerate_triangles", "dropped_triangles", "seconds"),
        *("root_groups", "root_triangles", "stuck_groups"),
    ]
    report: dict[str, Any] = {
        "input_triangles": sum(reports[mesh]["input_triangles"] for mesh, _ in instances),
        "input_vertices": sum(reports[mesh]["input_vertices"] for mesh, _ in instances),
        "stored_triangles": sum(one["input_triangles"] for one in reports),
        **{key: sum(one[key] for one in reports) for key in sums},
        "groups_by_rung": {
            method: sum(one["groups_by_rung"][method] for one in reports)
            for method in reports[0]["groups_by_rung"]
        },
        "groups_by_reason": {
            method: _summed([one["groups_by_reason"][method] for one in reports])
            for method in reports[0]["groups_by_reason"]
        },
        "waits_by_reason": _summed([one["waits_by_reason"] for one in reports]),
        "largest_move": float((own * scales[:, 1] + moved).max()),
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
