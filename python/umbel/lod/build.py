"""Building the levels of detail of one mesh."""

from __future__ import annotations

import inspect
import math
import operator
import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.arrays import (
    about,
    array_of,
    as_mesh,
    extras_of,
    indices,
    mesh_of,
    native,
    rows,
    thread_count,
)
from umbel.geometry.mesh import Mesh
from umbel.geometry.precision_loss import refuse_collapse, warn_of_rounding
from umbel.geometry.repair import DROPS, Progress, grid_step
from umbel.geometry.repair import drop_invalid as drop_invalid_triangles
from umbel.io import load_scene
from umbel.lod.lod import Lod

if TYPE_CHECKING:
    from umbel.scale.executor import Executor
    from umbel.scale.stored_lod import StoredLod

SEAM_RULES = {"protect": 0, "allow": 1, "ignore": 2}

Decimate = Callable[..., Any]
"""See `build_lod`."""


@overload
def build_lod(
    mesh: Any,
    *,
    max_triangles: int = 128,
    max_vertices: int = 128,
    min_triangles: int = 0,
    underfill_cost: float = 0.3,
    vertex_underfill_cost: float = 0.5,
    overlap_cost: float = 0.0,
    group_size: Sequence[int] = (24, 32),
    group_underfill_cost: float = 0.5,
    group_overlap_cost: float = 0.0,
    ratio: float = 0.5,
    attributes: str = "auto",
    normal_weight: float = 0.5,
    uv_weight: float = 0.5,
    color_weight: float = 0.5,
    tangent_weight: float = 0.25,
    skin_weight: float = 0.5,
    mix_materials: bool = False,
    keep_area: bool = True,
    seams: str = "allow",
    creases: str = "allow",
    refit_attributes: bool = True,
    measured_error: bool = False,
    max_levels: int = 0,
    stop_triangles: int = 0,
    max_error: float = math.inf,
    lock_borders: bool = False,
    locked: ArrayLike | None = None,
    decimate: Decimate | None = None,
    drop_invalid: bool = False,
    precision: str | float | None = None,
    allow_outside: bool = False,
    force: bool = False,
    memory: None = None,
    work: None = None,
    resume: Literal[False] = False,
    unit_triangles: None = None,
    executor: None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> Lod: ...


@overload
def build_lod(mesh: Any, *, resume: bool = False, **in_units: Any) -> StoredLod: ...


def build_lod(  # type: ignore[misc]  # the second overload does not list all settings again
    mesh: Any,
    *,
    max_triangles: int = 128,
    max_vertices: int = 128,
    min_triangles: int = 0,
    underfill_cost: float = 0.3,
    vertex_underfill_cost: float = 0.5,
    overlap_cost: float = 0.0,
    group_size: Sequence[int] = (24, 32),
    group_underfill_cost: float = 0.5,
    group_overlap_cost: float = 0.0,
    ratio: float = 0.5,
    attributes: str = "auto",
    normal_weight: float = 0.5,
    uv_weight: float = 0.5,
    color_weight: float = 0.5,
    tangent_weight: float = 0.25,
    skin_weight: float = 0.5,
    mix_materials: bool = False,
    keep_area: bool = True,
    seams: str = "allow",
    creases: str = "allow",
    refit_attributes: bool = True,
    measured_error: bool = False,
    max_levels: int = 0,
    stop_triangles: int = 0,
    max_error: float = math.inf,
    lock_borders: bool = False,
    locked: ArrayLike | None = None,
    decimate: Decimate | None = None,
    drop_invalid: bool = False,
    precision: str | float | None = None,
    allow_outside: bool = False,
    force: bool = False,
    memory: float | str | None = None,
    work: str | os.PathLike[str] | None = None,
    resume: bool = False,
    unit_triangles: int | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> Lod | StoredLod:
    """Builds the DAG of a mesh, a path, or anything with .vertices and .faces.

    With `memory`, `work`, `unit_triangles` or `executor` a mesh of any size, in units
    (docs/scale.md): what comes back then is a `StoredLod`, an open `Asset`. The mesh may also be
    several paths or an iterable of blocks, as `build_asset` takes them.

    max_triangles, max_vertices: most a cluster may have (4..256, 6..256; 0: no limit but 256).
    min_triangles: least a cluster should have; 0: a quarter of max_triangles.
    underfill_cost, vertex_underfill_cost, overlap_cost: 0..1, as for `cluster_mesh`.
    group_size: least and most clusters that are simplified together.
    group_underfill_cost, group_overlap_cost: the same penalties, of groups.
    ratio: triangles that each level keeps of the one before (0.1..0.9).
    attributes: "auto" keeps normals, tangents, all sets of UVs, colours, joints and their weights,
        and weighs them in the error by the weights (`skin_weight`: how much each joint moves a
        vertex); "none" drops them. Materials stay either way.
    keep_area: where many small components (leaves, rubble) shrink or are removed, the others are
        enlarged until they cover as much area as before.
    mix_materials: clusters may mix materials, which are kept triangle by triangle. Borders between
        materials are held all the same.
    seams, creases: how lines are held along which vertices at one position have different UVs or
        colours, and different normals only: "protect" (they shorten along themselves, until
        nothing else is left to simplify), "allow" (what crossing them costs the attributes counts
        as error), or "ignore" (it costs nothing). Borders between materials are always kept.
    refit_attributes: remaining vertices take the normals and colours that fit the collapsed ones
        best.
    measured_error: errors are distances to the source in both directions, measured by samples,
        instead of sums of what each step moved; takes 1.3 to 4.5 times as long.
    max_levels, stop_triangles, max_error: stop after so many levels (0: no limit), as soon as no
        more triangles than that are left, and before any group's error gets larger. What is left
        then are the roots.
    lock_borders: open edges stay as they are in every cut, so that parts of a larger mesh that are
        built apart join without a crack. Coarse levels cannot have fewer triangles than that needs.
    locked: (n,) bool, vertices whose positions, and the open edges between them, stay likewise.
    decimate: simplifies a group instead of the library. Called with a Mesh of the group, (n,) bool
        `locked` (vertices that must stay, and the border between them), and the number of
        triangles that should be left. Returns None to leave the group to the library, or
        (triangles, error), or (triangles, error, added) where `added` is a Mesh without triangles
        whose vertices follow the group's own, or (triangles, error, added, materials) with one
        material a vertex where the group has several. Where that cannot take the group's place, a
        function of four arguments is called again, up to four times in all, with a sentence that
        says why (None at first). Called from one thread at a time, not always from the one that
        builds; what it raises ends the build.
    drop_invalid: leave out triangles with NaN, infinite or missing vertices instead of raising.
    precision: snap positions to a power-of-two grid first, which makes files several times
        smaller; None keeps every bit. A number is a length in the mesh's unit, a string as in
        `umbel build --precision`.
    allow_outside: of a path, as `umbel.load` has it.
    force: build even where over 1 % of the triangles lose their area, by `precision` or because
        float32 cannot hold where their vertices are; that raises otherwise.
    memory: most bytes that a build in units takes, or a text such as "2GB"; by default three
        quarters of what is free.
    work: a folder for what is built before it is whole, some 45 bytes a triangle; by default one
        for temporary files. With an executor one that all machines have, or an address.
    resume: go on with what an earlier call with the same arguments left in `work`.
    unit_triangles: most triangles of a unit, by default 4 Mi.
    executor: builds units elsewhere, such as `umbel.scale.Ray()`: see `build_asset`.
    progress: called with (fraction, stage); returning False cancels (umbel.Cancelled).
    """
    # Long, because every setting is named and described here.
    if attributes not in ("auto", "none"):
        raise Error(f"attributes must be 'auto' or 'none', not {attributes!r}")
    config: dict[str, Any] = {
        "max_triangles": max_triangles,
        "max_vertices": max_vertices,
        "min_triangles": min_triangles,
        "underfill_cost": underfill_cost,
        "vertex_underfill_cost": vertex_underfill_cost,
        "overlap_cost": overlap_cost,
        **_group_limits(group_size),
        "group_underfill_cost": group_underfill_cost,
        "group_overlap_cost": group_overlap_cost,
        "ratio": ratio,
        "position_step": 0.0,
        "attributes": attributes == "auto",
        "normal_weight": normal_weight,
        "uv_weight": uv_weight,
        "color_weight": color_weight,
        "tangent_weight": tangent_weight,
        "skin_weight": skin_weight,
        "mix_materials": mix_materials,
        "keep_area": keep_area,
        "seams": seams,
        "creases": creases,
        "refit_attributes": refit_attributes,
        "max_levels": max_levels,
        "stop_triangles": stop_triangles,
        "measured_error": measured_error,
        "lock_borders": lock_borders,
    }
    if max_error != math.inf:
        config["max_error"] = max_error
    given_limits = (memory, work, unit_triangles, executor)
    if resume or any(limit is not None for limit in given_limits):
        from umbel.scale.stored_lod import build_stored

        refused = {
            "locked": locked is not None,
            "decimate": decimate is not None,
            "drop_invalid": drop_invalid,
            "precision": precision is not None,
        }
        limits: dict[str, Any] = {"memory": memory, "resume": resume, "force": force}
        limits |= {"unit_triangles": unit_triangles or 0, "executor": executor}
        limits |= {"allow_outside": allow_outside}
        return build_stored(mesh, config, refused, limits, work, progress, threads)
    _warn_of_size(mesh)
    given = _one_mesh(mesh, allow_outside)
    source = _describe(mesh, given)
    if attributes == "none":
        given = _without_attributes(given)
    extra: dict[str, Any] = {"dropped_triangles": 0}
    if drop_invalid:
        given, extra["dropped_triangles"] = drop_invalid_triangles(given, threads=threads)
    if precision is not None:
        extra["grid_step"] = config["position_step"] = grid_step(given, precision)
    if not force:
        refuse_collapse(given, extra.get("grid_step"))
    warn_of_rounding(given)
    with about(given, DROPS):
        dag = _umbel.build_lod(
            native(given),
            _native_config(config),
            progress,
            thread_count(threads),
            None if decimate is None else _decimator(decimate),
            None if locked is None else _locked(locked),
        )
    extra["largest_move"] = dag.report["largest_move"] + given.rounding.largest_move
    report = {**dag.report, **extra}
    materials, name = given.materials, given.name
    built = Lod(dag, report, config, source, materials, name, given.tree, given.origin)
    built.coordinates = given.coordinates
    return built


def _warn_of_size(source: Any) -> None:
    """Before the system ends a build that takes more memory than there is."""
    if not isinstance(source, (str, os.PathLike)):
        return
    from umbel.scale.memory import is_too_large

    if is_too_large(source):
        sentence = (
            f"building {os.fspath(source)} in memory may take more than is free; with memory= or "
            "work= it is built in units, on disk"
        )
        warnings.warn(sentence, RuntimeWarning, stacklevel=3)


def _one_mesh(source: Any, allow_outside: bool) -> Mesh:
    """As `as_mesh`, with a warning where the nodes of a file get lost."""
    if not isinstance(source, (str, os.PathLike)):
        return as_mesh(source)
    scene = load_scene(source, allow_outside=allow_outside)
    lost = scene.merge_loss()
    if lost:
        sentence = f"{os.fspath(source)}: {lost}; build_scene(..., instances='on') keeps its nodes"
        warnings.warn(sentence, LoadWarning, stacklevel=3)
    return scene.flatten()


def _without_attributes(mesh: Mesh) -> Mesh:
    """Positions, triangles and materials alone."""
    return replace(
        mesh,
        normals=None,
        tangents=None,
        uvs=None,
        colors=None,
        uv_sets=[],
        joints=None,
        weights=None,
    )


def _native_config(config: dict[str, Any]) -> _umbel.LodConfig:
    native_config = _umbel.LodConfig()
    for key, value in config.items():
        try:
            rule = key in ("seams", "creases")
            setattr(native_config, key, SEAM_RULES[value] if rule else value)
        except KeyError:
            raise Error(f"{key} must be one of {', '.join(SEAM_RULES)}, not {value!r}") from None
        except TypeError:
            raise Error(f"{key} cannot be {value!r}") from None
    return native_config


def _group_limits(group_size: Sequence[int]) -> dict[str, int]:
    try:
        low, high = (operator.index(value) for value in group_size)
    except (TypeError, ValueError):
        raise Error(f"group_size must be two integers, not {group_size!r}") from None
    return {"min_group": low, "max_group": high}


def _describe(source: Any, mesh: Mesh) -> dict[str, Any]:
    described: dict[str, Any] = {"triangles": len(mesh.triangles), "vertices": len(mesh.positions)}
    if isinstance(source, (str, os.PathLike)):
        described["file"] = Path(source).name
    return described


def _locked(locked: ArrayLike) -> NDArray[np.uint8]:
    given = array_of("locked", locked)
    if given.ndim != 1:
        raise Error(f"locked must have shape (n,), not {given.shape}")
    if given.dtype != bool and not np.isin(given, (0, 1)).all():
        raise Error(f"locked must be true or false for each vertex, not numbers ({given.dtype})")
    return np.ascontiguousarray(given.astype(bool)).view(np.uint8)


def _takes_reasons(decimate: Decimate) -> bool:
    try:
        inspect.signature(decimate).bind(None, None, 0, None)
    except (TypeError, ValueError):
        return False
    return True


def _decimator(decimate: Decimate) -> Callable[..., Any]:
    takes_reasons = _takes_reasons(decimate)

    def ask(
        arrays: dict[str, Any], locked: NDArray[np.uint8], target: int, refused: str | None
    ) -> Any:
        if refused is not None and not takes_reasons:
            return None
        reasons = (refused,) if takes_reasons else ()
        answer = decimate(mesh_of(arrays, []), locked.astype(bool), target, *reasons)
        if answer is None:
            return None
        triangles, error, *rest = answer
        made: dict[str, Any] = {"triangles": indices("triangles", triangles, 3), "error": error}
        for mesh in rest[:1]:
            made["positions"] = rows("positions", mesh.positions, 3)
            for name, columns in (("normals", 3), ("tangents", 4), ("uvs", 2), ("colors", 4)):
                if getattr(mesh, name) is not None:
                    made[name] = rows(name, getattr(mesh, name), columns)
            values = extras_of(mesh)[1]
            if values is not None:
                made["extra_values"] = values
        if len(rest) > 1:
            made["materials"] = indices("materials", rest[1])
        return made

    return ask
