"""The tables of all files of a source, as C++ takes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.mesh import Material
from umbel.io.blocks.shared_materials import SharedMaterials
from umbel.io.files import text_of
from umbel.io.scene import NO_MATERIAL

#: Table, NumPy's name of the type without its byte order, offsets in the row, whether integers
#: stand for fractions.
Column = tuple[int, str, list[int], bool]


#: Kind and set, as the library numbers them, and where the values are.
Extra = tuple[int, int, Column]


@dataclass
class _Part:
    name: str
    columns: dict[str, Column]
    triangles: int
    material: int | None
    color_scale: tuple[float, float]  # what colours and alphas are divided by
    srgb_colors: bool
    transform: list[float] | None
    may_miss: bool  # the column of materials has rows without one
    extras: list[Extra]
    numbers: list[int] | None


@dataclass
class Layout:
    """Collects files, tables and parts, and the materials of all of them."""

    work: Path
    allow_outside: bool = False  #: of files that a file refers to: see `umbel.load`
    shared: SharedMaterials = field(default_factory=SharedMaterials)
    native: Any = field(default_factory=_umbel.TableLayout)
    parts: list[_Part] = field(default_factory=list)
    #: What files say of their scenes, each as `Asset.scene` has it of one mesh.
    trees: list[tuple[Path, dict[str, Any]]] = field(default_factory=list)
    vertices: int | None = 0  #: of all parts; None where a part's are not known
    #: What `again` makes the same layout of; None where it cannot. JSON.
    recipe: dict[str, list[Any]] | None = field(
        default_factory=lambda: {"files": [], "tables": [], "parts": []}
    )
    _rows: dict[int, int] = field(default_factory=dict)

    @property
    def materials(self) -> list[Material]:
        return self.shared.all

    def add_file(self, path: Path) -> int:
        self._note("files", str(path.absolute()))
        return int(self.native.add_file(path))

    def add_table(
        self, file: int, offset: int, stride: int, rows: int, big_endian: bool = False
    ) -> int:
        self._note("tables", [file, offset, stride, rows, big_endian])
        table = int(self.native.add_table(file, offset, stride, rows, big_endian))
        self._rows[table] = rows
        return table

    def add_part(
        self,
        name: str,
        columns: dict[str, Column],
        triangles: int = 0,
        material: int | None = None,
        color_scale: tuple[float, float] = (1.0, 1.0),
        srgb_colors: bool = False,
        transform: np.ndarray[Any, Any] | None = None,
        may_miss: bool = False,
        vertices: int | None = None,
        extras: list[Extra] | None = None,
        numbers: list[int] | None = None,
    ) -> None:
        """A mesh with vertices of its own. `material`: of all triangles; None: it has none, or a
        column of them. `numbers`: the materials that the values in the column are. `vertices`: how
        many, where no table says it. `extras`: further texture coordinates, joints and weights."""
        table, _, offsets, _ = columns["positions"]
        if table in self._rows:
            vertices = self._rows[table] * (len(offsets) // 3)
        if self.vertices is not None:
            self.vertices = None if vertices is None else self.vertices + vertices
        if transform is not None and np.array_equal(transform, np.eye(4)):
            transform = None
        rows = None if transform is None else transform[:3].reshape(-1).tolist()
        self.parts.append(
            _Part(
                text_of(name),
                columns,
                triangles,
                material,
                color_scale,
                srgb_colors,
                rows,
                may_miss,
                extras or [],
                numbers,
            )
        )

    def new_file(self, suffix: str) -> Path:
        """The name of a file in the work folder that no other of this source has."""
        try:
            self.work.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Error(f"cannot make the folder {self.work}: {error.strerror or error}") from None
        return self.work / f"source_{len(self.parts):06d}{suffix}"

    def finished(self) -> Any:
        """For `_umbel.TableSource`."""
        missing = any(
            (p.numbers is None and p.material in (None, NO_MATERIAL)) or p.may_miss
            for p in self.parts
        )
        default = len(self.materials)
        if self.materials and missing:
            # Only glTF's is of metal.
            of_gltf = any(p.material == NO_MATERIAL for p in self.parts)
            self.materials.append(Material(name="default", metallic=float(of_gltf)))
        for part in self.parts:
            material = part.material
            if material is None or material == NO_MATERIAL:
                material = default if self.materials else None
            what = (part.name, part.columns, part.triangles, material, default)
            colors = (part.color_scale, part.srgb_colors)
            rest = (*colors, part.transform, part.extras, part.numbers or [])
            self._note("parts", [*what, *rest])
            self.native.add_part(*what, *rest)
        return self.native

    def _note(self, what: str, value: Any) -> None:
        if self.recipe is not None:
            self.recipe[what].append(value)


def again(recipe: dict[str, list[Any]]) -> Any:
    """For `_umbel.TableSource`, of a recipe; its files may be elsewhere now."""
    native = _umbel.TableLayout()
    for file in recipe["files"]:
        native.add_file(file)
    for table in recipe["tables"]:
        native.add_table(*table)
    for name, columns, *rest, extras, numbers in recipe["parts"]:
        sets = [(kind, number, tuple(column)) for kind, number, column in extras]
        own = {k: tuple(column) for k, column in columns.items()}
        native.add_part(*[name, own, *rest, sets, numbers])
    return native
