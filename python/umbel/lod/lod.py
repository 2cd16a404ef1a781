"""Building continuous levels of detail."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.arrays import (
    about,
    as_mesh,
    extras_of,
    indices,
    mesh_of,
    native,
    numbers,
    rows,
    thread_count,
    whole,
)
from umbel.geometry.mesh import Material, Mesh
from umbel.geometry.origin import origin_of, relative_transform, zero_origin
from umbel.geometry.precision_loss import refuse_collapse, warn_of_rounding
from umbel.geometry.repair import DROPS, Progress, grid_step
from umbel.geometry.repair import drop_invalid as drop_invalid_triangles
from umbel.io import load_scene
from umbel.io.gltf.tree import is_trivial
from umbel.lod.materials import write_materials
from umbel.lod.metadata import encode
from umbel.lod.tables import HasTables
from umbel.lod.verify import VerifyReport

PAGE_BYTES = 40 << 10
"""Most bytes of a page of several groups, unless something else is asked for."""


def metadata_of(built: Any, name: str) -> dict[str, Any]:
    """What an asset says of a Lod or SceneLod; `seconds` differ between two builds of one mesh."""
    said: dict[str, Any] = {
        "generator": f"umbel {_umbel.version()}",
        "name": name,
        "config": built.config,
        "source": built.source,
        "report": {key: value for key, value in built.report.items() if key != "seconds"},
    }
    return said | ({"coordinates": built.coordinates} if built.coordinates else {})


class Lod(HasTables):
    """A mesh as a DAG of clusters, in memory. `build_lod` makes it, `save` writes it."""

    _native: _umbel.Dag

    def __init__(
        self,
        dag: _umbel.Dag,
        report: dict[str, Any],
        config: dict[str, Any],
        source: dict[str, Any],
        materials: list[Material],
        name: str,
        tree: dict[str, Any] | None = None,
        origin: NDArray[np.float64] | None = None,
    ) -> None:
        self._native = dag
        self.origin = zero_origin() if origin is None else origin
        """Where the mesh lies: tables are relative to it."""
        self._materials = materials
        self._name = name
        self._tree = tree or {}
        self.report = report
        """What was built: counts, groups by how they were simplified, `seconds` of the build."""
        self.config = config
        """The settings that it was built with."""
        self.source = source
        """What it was built from."""
        self.coordinates: dict[str, str] = {}
        """See `Mesh.coordinates`."""

    def __repr__(self) -> str:
        tables = self.tables
        return f"<Lod: {len(tables.clusters)} clusters on {len(tables.levels)} levels>"

    @property
    def reasons(self) -> list[str]:
        """For each group what stood most in the way where the first rung alone did not simplify it
        to 70 %, "none" where it did, or why it is a root (docs/lod.md)."""
        return list(self._native.reasons)

    @property
    def levels(self) -> NDArray[Any]:
        """See `Tables.levels`."""
        return self.tables.levels

    @property
    def groups(self) -> NDArray[Any]:
        """See `Tables.groups`."""
        return self.tables.groups

    @property
    def clusters(self) -> NDArray[Any]:
        """See `Tables.clusters`."""
        return self.tables.clusters

    @property
    def nodes(self) -> NDArray[Any]:
        """See `Tables.nodes`."""
        return self.tables.nodes

    @property
    def _mesh_origin(self) -> NDArray[np.float64]:
        return self.origin

    def mesh(self, cut: ArrayLike) -> Mesh:
        """A cut as an ordinary mesh, its clusters joined where they meet."""
        arrays = self._native.mesh(indices("cut", cut))
        made = mesh_of(arrays, self._materials, self._name, self.origin)
        made.tree, made.coordinates = self._tree, self.coordinates
        return made

    def verify(
        self,
        cuts: int = 64,
        *,
        seed: int = 1,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> VerifyReport:
        """The checks of `umbel.verify`, without those of a file."""
        return VerifyReport(
            **self._native.verify(
                whole("cuts", cuts), whole("seed", seed), progress, thread_count(threads)
            )
        )

    def metadata(self) -> dict[str, Any]:
        """What `save` writes beside the geometry. Holds nothing that differs between two builds
        of the same mesh."""
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
        """Writes the asset beside `path` and renames it, so that a file of that name is always
        whole. Returns its bytes.

        exact: keep every bit of normals, tangents, UVs and colours, or store them in fewer bits
            (docs/format.md); None: as the build did with positions, exactly without `precision`.
        textures: "embed" the materials' images, leave them "external" where they are files of
            their own, or "none".
        page_bytes: what is read at once, at most, where one group does not take more.
        """
        return save_asset(
            path,
            [self],
            metadata=self.metadata(),
            exact=exact,
            textures=textures,
            page_bytes=page_bytes,
            origin=self.origin,
            scene={} if is_trivial(self._tree) else self._tree,
            progress=progress,
            threads=threads,
        )


def save_asset(
    path: str | os.PathLike[str],
    lods: Sequence[Lod],
    instances: Sequence[tuple[int, ArrayLike]] = (),
    *,
    metadata: dict[str, Any] | None = None,
    exact: bool | None = None,
    textures: str = "embed",
    page_bytes: int = PAGE_BYTES,
    origin: ArrayLike | None = None,
    scene: dict[str, Any] | None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> int:
    """Writes several meshes as one asset, each with its materials; equal ones are stored once.
    Returns its bytes.

    instances: which mesh is where: (index into `lods`, (3, 4) or (4, 4) matrix that takes column
        vectors from the mesh to the world). None: every mesh once, where it is.
    metadata: what `Asset.info["metadata"]` shall be.
    origin: where the asset lies: it is kept relative to that. None: where the first mesh lies.
    scene: what `Asset.scene` shall be.
    The rest is as `Lod.save` has it.
    """
    around = origin_of(origin if origin is not None else lods[0].origin if lods else zero_origin())
    if not instances and any(not np.array_equal(lod.origin, around) for lod in lods):
        instances = [(k, np.eye(4)) for k in range(len(lods))]
    meshes, transforms = _placed(lods, instances, around)
    keep = exact
    if keep is None:
        keep = any(lod.config["position_step"] == 0 for lod in lods)
    folder = Path(os.fspath(path)).absolute().parent
    all_materials, firsts = _joined([lod._materials for lod in lods])
    materials, files = write_materials(all_materials, textures, folder, thread_count(threads))
    return _umbel.write_asset(
        os.fspath(path),
        [lod._native for lod in lods],
        encode(metadata if metadata is not None else {"generator": f"umbel {_umbel.version()}"}),
        materials,
        np.array(firsts, np.uint32),
        files,
        meshes.astype(np.uint32),
        transforms.reshape(-1, 12),
        keep,
        page_bytes,
        progress,
        thread_count(threads),
        around.tolist(),
        encode(scene) if scene else "",
    )


def _placed(
    lods: Sequence[Lod],
    instances: Sequence[tuple[int, ArrayLike]],
    origin: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The instances' meshes, and the matrices that take meshes without their own origins to the
    world without `origin`."""
    for instance in instances:
        if not isinstance(instance, Sequence) or len(instance) != 2:
            raise Error("instances must be pairs of a mesh's index and a matrix")
    meshes = np.array([whole("an instance's mesh", mesh) for mesh, _ in instances], np.int64)
    given = [numbers("an instance's transform", matrix) for _, matrix in instances]
    if any(matrix.shape not in ((3, 4), (4, 4)) for matrix in given):
        raise Error("an instance's transform must have shape (3, 4) or (4, 4)")
    if len(meshes) and not 0 <= meshes.min() <= meshes.max() < len(lods):
        raise Error(f"an instance is of mesh {meshes.max()}, but there are {len(lods)}")
    local = [
        relative_transform(matrix, lods[mesh].origin, origin)
        for mesh, matrix in zip(meshes, given, strict=True)
    ]
    return meshes, np.array(local, np.float32)


def _joined(lists: list[list[Material]]) -> tuple[list[Material], list[int]]:
    """All materials, and where those of each list begin. Who has none gets the default."""
    if any(lists):
        lists = [materials or [Material()] for materials in lists]
    joined: list[Material] = []
    firsts: list[int] = []
    for i, materials in enumerate(lists):
        same = next((j for j in range(i) if lists[j] == materials), None)
        firsts.append(len(joined) if same is None else firsts[same])
        if same is None:
            joined += materials
    return joined, firsts


SEAM_RULES = {"protect": 0, "allow": 1, "ignore": 2}

Decimate = Callable[[Mesh, NDArray[np.bool_], int], Any]
"""See `build_lod`."""


def _decimator(decimate: Decimate) -> Callable[[dict[str, Any], NDArray[np.uint8], int], Any]:
    def ask(arrays: dict[str, Any], locked: NDArray[np.uint8], target: int) -> Any:
        answer = decimate(mesh_of(arrays, []), locked.astype(bool), target)
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


def build_lod(
    mesh: Any,
    *,
    max_triangles: int = 128,
    max_vertices: int = 128,
    group_size: Sequence[int] = (24, 32),
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
    decimate: Decimate | None = None,
    drop_invalid: bool = False,
    precision: str | float | None = None,
    allow_outside: bool = False,
    force: bool = False,
    progress: Progress | None = None,
    threads: int = 0,
) -> Lod:
    """Builds the DAG of a mesh, a path, or anything with .vertices and .faces.

    max_triangles, max_vertices: most a cluster may have (4..256, 6..256).
    group_size: least and most clusters that are simplified together.
    ratio: triangles that each level keeps of the one before (0.1..0.9).
    attributes: "auto" keeps normals, tangents, all sets of UVs, colours, joints and their weights,
        and weighs them in the error by the weights (`skin_weight`: how much each joint moves a
        vertex); "none" drops them. Materials stay either way.
    keep_area: where many small parts (leaves, rubble) shrink or vanish, those that are left are
        enlarged until they cover as much area as before.
    mix_materials: clusters may mix materials, which are kept triangle by triangle. Borders between
        materials are held all the same.
    seams, creases: how lines are held along which vertices at one position have different UVs or
        colours, and different normals only: "protect" (they shorten along themselves, until
        nothing else is left to simplify), "allow" (what crossing them costs the attributes counts
        as error), or "ignore" (it costs nothing). Borders between materials are always kept.
    refit_attributes: vertices that stay take the normals and colours that fit best to all that
        they stand for.
    measured_error: errors are distances to the source in both directions, measured by samples,
        instead of sums of what each step moved; takes about twice as long.
    max_levels, stop_triangles, max_error: stop after so many levels (0: no limit), as soon as no
        more triangles than that are left, and before any group's error gets larger. What is left
        then are the roots.
    decimate: simplifies a group instead of the library. Called with a Mesh of the group, (n,) bool
        `locked` (vertices that must stay, and the border between them), and the number of
        triangles that should be left. Returns None to leave the group to the library, or
        (triangles, error), or (triangles, error, added) where `added` is a Mesh without triangles
        whose vertices follow the group's own, or (triangles, error, added, materials) with one
        material a vertex where the group has several. Called from one
        thread at a time, not always from the one that builds.
    drop_invalid: leave out triangles with NaN, infinite or missing vertices instead of raising.
    precision: snap positions to a power-of-two grid first, which makes files several times
        smaller; None keeps every bit. A number is a length in the mesh's unit, a string as in
        `umbel build --precision`.
    allow_outside: of a path, as `umbel.load` has it.
    force: build even where over 1 % of the triangles lose their area, by `precision` or because
        float32 cannot hold where their vertices are; that raises otherwise.
    progress: called with (fraction, stage); returning False cancels (umbel.Cancelled).
    """
    given = _one_mesh(mesh, allow_outside)
    source = _describe(mesh, given)
    if attributes not in ("auto", "none"):
        raise Error(f"attributes must be 'auto' or 'none', not {attributes!r}")
    if attributes == "none":
        given = replace(
            given,
            normals=None,
            tangents=None,
            uvs=None,
            colors=None,
            uv_sets=[],
            joints=None,
            weights=None,
        )
    extra: dict[str, Any] = {"dropped_triangles": 0}
    if drop_invalid:
        given, extra["dropped_triangles"] = drop_invalid_triangles(given, threads=threads)
    if precision is not None:
        extra["grid_step"] = grid_step(given, precision)
    if not force:
        refuse_collapse(given, extra.get("grid_step"))
    warn_of_rounding(given)

    low, high = _pair(group_size)
    config: dict[str, Any] = {
        "max_triangles": max_triangles,
        "max_vertices": max_vertices,
        "min_group": low,
        "max_group": high,
        "ratio": ratio,
        "position_step": extra.get("grid_step", 0.0),
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
    }
    if max_error != math.inf:
        config["max_error"] = max_error
    with about(given, DROPS):
        dag = _umbel.build_lod(
            native(given),
            _native_config(config),
            progress,
            thread_count(threads),
            None if decimate is None else _decimator(decimate),
        )
    extra["largest_move"] = dag.report["largest_move"] + given.rounding.largest_move
    report = {**dag.report, **extra}
    materials, name = given.materials, given.name
    built = Lod(dag, report, config, source, materials, name, given.tree, given.origin)
    built.coordinates = given.coordinates
    return built


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


def _pair(group_size: Sequence[int]) -> tuple[int, int]:
    try:
        low, high = (int(value) for value in group_size)
    except (TypeError, ValueError):
        raise Error(f"group_size must be two integers, not {group_size!r}") from None
    return low, high


def _describe(source: Any, mesh: Mesh) -> dict[str, Any]:
    described: dict[str, Any] = {"triangles": len(mesh.triangles), "vertices": len(mesh.positions)}
    if isinstance(source, (str, os.PathLike)):
        described["file"] = Path(source).name
    return described
