"""A mesh as a DAG of clusters, in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.geometry.arrays import indices, mesh_of
from umbel.geometry.mesh import Material, Mesh
from umbel.geometry.origin import origin_of, zero_origin
from umbel.io.gltf.tree import is_trivial
from umbel.lod.save import Savable
from umbel.lod.tables import HasTables


def _from_tables(name: str) -> Any:
    """A property that is one of the tables."""
    return property(lambda lod: getattr(lod.tables, name), doc=f"See `Tables.{name}`.")


class Lod(HasTables, Savable):
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
        self.origin = zero_origin() if origin is None else origin_of(origin)
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
    def limiting_factors(self) -> list[str]:
        """For each group what kept the first simplification method from reaching 70 %, "none" where
        it did, or why the group is a root (docs/lod.md)."""
        return list(self._native.limiting_factors)

    @property
    def source_vertices(self) -> NDArray[np.uint32]:
        """Of the vertices of all clusters, one cluster after the other, each in the order of its
        own: the vertex of the mesh that it is, so that a renderer can keep its own vertex buffer,
        or 0xffffffff where it is new."""
        return self._native.source_vertices[self._native.cluster_vertices]

    levels: NDArray[Any] = _from_tables("levels")
    groups: NDArray[Any] = _from_tables("groups")
    clusters: NDArray[Any] = _from_tables("clusters")
    nodes: NDArray[Any] = _from_tables("nodes")

    @property
    def _mesh_origin(self) -> NDArray[np.float64]:
        return self.origin

    def mesh(self, cut: ArrayLike) -> Mesh:
        """A cut as an ordinary mesh, its clusters joined where they meet."""
        arrays = self._native.mesh(indices("cut", cut))
        made = mesh_of(arrays, self._materials, self._name, self.origin)
        made.tree, made.coordinates = self._tree, self.coordinates
        return made

    def _saved(self) -> dict[str, Any]:
        tree = {} if is_trivial(self._tree) else self._tree
        return {"lods": [self], "scene": tree}
