"""Reading .umbel files."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import indices, mesh_of, whole
from umbel.geometry.camera import Camera
from umbel.geometry.mesh import Material, Mesh
from umbel.geometry.origin import zero_origin
from umbel.geometry.repair import Progress
from umbel.io.files import text_of
from umbel.io.scene import Scene
from umbel.lod.instances import InstanceCut, scene_cuts, scene_error, scene_mesh, shown_scene
from umbel.lod.materials import read_materials
from umbel.lod.remote import BinaryFile, readable, remote
from umbel.lod.tables import HasTables, Tables
from umbel.lod.verify import VerifyReport, verify_arguments


class Asset(HasTables):
    """An open .umbel file: tables in memory, geometry read page by page as it is needed. Safe to
    use from many threads.

    source: a path; a URL that fsspec understands (https://, s3://, zip://..::.., memory://: the
        extra `umbel[remote]`), read in ranges; or an open binary file.
    """

    _native: _umbel.Asset

    def __init__(self, source: str | os.PathLike[str] | BinaryFile) -> None:
        if isinstance(source, (str, os.PathLike)):
            self.path = os.fspath(source)
            if "://" in self.path:
                self._native = _umbel.SourceAsset(*remote(self.path), text_of(self.path))
            else:
                self._native = _umbel.Asset(self.path)
        else:
            self.path = str(getattr(source, "name", source))
            self._native = _umbel.SourceAsset(*readable(source), text_of(self.path))
        self._info: dict[str, Any] | None = None

    def __repr__(self) -> str:
        return f"umbel.Asset({self.path!r})"

    @property
    def info(self) -> dict[str, Any]:
        """What the file says of itself: format version, sizes, bounds, limits, and the metadata
        written with it."""
        if self._info is None:
            info = self._native.info
            try:
                info["metadata"] = json.loads(info["metadata"] or "{}")
            except ValueError as error:
                raise Error(f"{self.path}: the metadata is no JSON ({error})") from None
            if not isinstance(info["metadata"], dict):
                raise Error(f"{self.path}: the metadata is no JSON object")
            self._info = info
        return self._info

    @property
    def meshes(self) -> list[dict[str, Any]]:
        """Each mesh's `bounds source_triangles source_vertices source_digest levels groups
        clusters`, and whether it has `normals tangents uvs colors`."""
        return self._native.meshes

    @property
    def instances(self) -> list[tuple[int, NDArray[Any]]]:
        """Which mesh is where: (index, (3, 4) matrix that takes column vectors to the world). An
        empty list: every mesh once, where it is. In float64 where the asset has an origin."""
        meshes, rows = self._native.instance_meshes(), self._native.transforms()
        matrices: NDArray[Any] = rows.reshape(-1, 3, 4)
        if self.origin.any():
            matrices = matrices.astype(np.float64)
            matrices[:, :, 3] += self.origin
        return [(int(m), matrix) for m, matrix in zip(meshes, matrices, strict=True)]

    @property
    def has_instance_tree(self) -> bool:
        """Whether the instances are a tree, which `InstanceSelector` selects from. `instances` are
        then the few that stand for all of them from afar."""
        return _umbel.has_instance_tree(self._native)

    @property
    def instance_count(self) -> int:
        """All instances, those of a tree too; without any, every mesh is shown once."""
        if self.has_instance_tree:
            return int(_umbel.instance_nodes(self._native)["instances"][0])
        return len(self._native.instance_meshes()) or len(self.meshes)

    @property
    def _mesh_origin(self) -> NDArray[np.float64]:
        """Where meshes lie: with instances those take them to the world, origin and all."""
        return zero_origin() if len(self._native.instance_meshes()) else self.origin

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,): where the asset lies. Its meshes, instances and tables are relative to it."""
        return np.array(self._native.info["origin"])

    @property
    def coordinates(self) -> dict[str, str]:
        """What is known of the world's coordinates: see `Mesh.coordinates`."""
        said = self.info["metadata"].get("coordinates")
        return dict(said) if isinstance(said, dict) else {}

    @property
    def scene(self) -> dict[str, Any]:
        """What is kept of the file's scene: names, hierarchy, cameras, extras, copyright
        (docs/format.md, section SCEN). Empty where there is nothing."""
        try:
            scene = json.loads(self._native.scene or "{}")
        except ValueError as error:
            raise Error(f"{self.path}: the scene is no JSON ({error})") from None
        return scene if isinstance(scene, dict) else {}

    @property
    def page_sizes(self) -> NDArray[np.uint32]:
        """Bytes of each page, in the order of the file: coarsest first."""
        return self._native.page_sizes()

    @property
    def materials(self) -> list[Material]:
        """The materials, with their images."""
        folder = None if "://" in self.path else Path(self.path).absolute().parent
        return read_materials(self._native.materials, self._native.file, folder)

    @property
    def tables(self) -> Tables:
        """Levels, groups, clusters and nodes of the first mesh. The first call reads every page."""
        return self.mesh_tables(0)

    def mesh_tables(self, mesh: int) -> Tables:
        """Levels, groups, clusters and nodes of one mesh."""
        return Tables(self._native.mesh_tables(whole("mesh", mesh)), self._mesh_origin)

    def mesh(self, cut: ArrayLike, mesh: int = 0) -> Mesh:
        """A cut of one of the meshes as an ordinary mesh, its clusters joined where they meet."""
        made = self._mesh(cut, mesh, self.materials)
        if len(self.meshes) == 1 and not self.instances:
            made.tree = self.scene
        return made

    def _mesh(
        self,
        cut: ArrayLike,
        mesh: int,
        materials: list[Material],
        found: _umbel.FoundCut | None = None,
    ) -> Mesh:
        if found is None:
            arrays = self._native.mesh(indices("cut", cut), whole("mesh", mesh))
        else:
            arrays = self._native.found_mesh(found)
        name = self.info["metadata"].get("name", "")
        made = mesh_of(arrays, materials, name, self._mesh_origin)
        made.coordinates = self.coordinates
        return made

    def verify(
        self,
        cuts: int = 64,
        *,
        seed: int = 1,
        memory: int | None = None,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> VerifyReport:
        """The checks of `umbel.verify`, with its arguments."""
        how = verify_arguments(cuts, seed, progress, threads, memory)
        return VerifyReport(**self._native.verify(*how))

    def scene_cuts(
        self,
        *,
        error: float | None = None,
        camera: Camera | None = None,
        level: int | None = None,
        triangles: int | None = None,
        or_coarsest: bool = False,
    ) -> list[InstanceCut]:
        """The cuts of all meshes one for each instance, with `mesh transform cut`. Reads the pages
        that they need and no tables, however large the asset is.
        Exactly one of error (at most so much, in the scene's unit; `math.inf` gives the coarsest
        cuts), camera (in the scene), level (a mesh that has fewer shows its coarsest), and
        triangles (at most so many in all; where no cuts have so few that raises, or gives the
        coarsest with `or_coarsest`)."""
        return scene_cuts(
            self,
            error=error,
            camera=camera,
            level=level,
            triangles=triangles,
            or_coarsest=or_coarsest,
        )

    def scene_of(self, shown: Sequence[InstanceCut]) -> Scene:
        """All that is shown, each mesh once for each of its cuts, on the nodes of the file that the
        asset is from. `umbel.save` writes it as glTF with them."""
        return shown_scene(self, shown)

    def scene_mesh(self, shown: Sequence[InstanceCut]) -> Mesh:
        """All that is shown, as one mesh in the scene."""
        return scene_mesh(self, shown)

    def scene_error(self, shown: Sequence[InstanceCut]) -> float:
        """The largest error of what is shown, in the scene's unit; 0 for level 0."""
        return scene_error(self, shown)

    def cluster(self, index: int, mesh: int = 0) -> Mesh:
        """The triangles of one cluster."""
        arrays = self._native.geometry(whole("index", index), whole("mesh", mesh))
        return mesh_of(arrays, [], origin=self._mesh_origin)
