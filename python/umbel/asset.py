""".umbel files."""

from __future__ import annotations

import json
import os
from typing import Any

from numpy.typing import ArrayLike

from . import _umbel
from .arrays import indices, mesh_of
from .errors import Error
from .mesh import Material, Mesh
from .metadata import materials_from_json
from .proof import VerifyReport, verify
from .repair import Progress
from .tables import HasTables


class Asset(HasTables):
    """An open .umbel file: tables in memory, geometry read page by page as it is needed. Safe to
    use from many threads."""

    _native: _umbel.Asset

    def __init__(self, path: str | os.PathLike[str]) -> None:
        text = os.fspath(path)
        if isinstance(text, str) and "://" in text:
            raise Error(f"{text}: assets are opened from files only")
        self.path = text
        self._native = _umbel.Asset(text)
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
            self._info = info
        return self._info

    def mesh(self, cut: ArrayLike) -> Mesh:
        """A cut as an ordinary mesh, its clusters joined where they meet."""
        metadata = self.info["metadata"]
        materials = materials_from_json(metadata.get("materials", []))
        return cut_mesh(self._native, cut, materials, metadata.get("name", ""))

    def cluster(self, index: int) -> Mesh:
        """The triangles of one cluster."""
        return mesh_of(self._native.geometry(index), [])

    def verify(
        self,
        cuts: int = 64,
        *,
        seed: int = 1,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> VerifyReport:
        """The same as `umbel.verify` on this file."""
        return verify(self.path, cuts, seed=seed, progress=progress, threads=threads)


def cut_mesh(
    native: _umbel.Asset | _umbel.Dag, cut: ArrayLike, materials: list[Material], name: str
) -> Mesh:
    """One cut of a DAG, wherever it is stored."""
    return mesh_of(native.mesh(indices("cut", cut)), materials, name)
