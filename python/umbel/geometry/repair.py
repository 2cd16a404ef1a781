"""Validating, repairing, welding and snapping meshes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import about, as_mesh, mesh_of, native, number, rows, thread_count
from umbel.geometry.mesh import Mesh

Progress = Callable[[float, str], "bool | np.bool_ | None"]

DROPS = "drop_invalid=True leaves such triangles out"
"""What helps where a build refuses a mesh."""


def stops(answer: object) -> bool:
    """Whether a progress callback that gave this wants no more: False, also NumPy's."""
    return isinstance(answer, (bool, np.bool_)) and not answer


def validate(mesh: Any, *, progress: Progress | None = None, threads: int = 0) -> None:
    """Raises umbel.Error naming the first triangle whose index is out of range, or the first
    vertex in use that is NaN or infinite. Degenerate and duplicate triangles are legal."""
    given = as_mesh(mesh)
    with about(given):
        _umbel.validate(native(given), progress, thread_count(threads))


def drop_invalid(
    mesh: Any, *, progress: Progress | None = None, threads: int = 0
) -> tuple[Mesh, int]:
    """The mesh without the triangles that `validate` would reject, and how many those were."""
    given = as_mesh(mesh)
    arrays, dropped = _umbel.drop_invalid(native(given), progress, thread_count(threads))
    return _remade(given, arrays), dropped


def weld(mesh: Any, *, progress: Progress | None = None, threads: int = 0) -> Mesh:
    """The mesh with vertices of equal position, attributes and material made one, and those that
    no triangle uses removed. Triangles keep their order and their corners'."""
    given = as_mesh(mesh)
    return _remade(given, _umbel.weld(native(given), progress, thread_count(threads)))


def _remade(given: Mesh, arrays: dict[str, Any]) -> Mesh:
    """The mesh with other arrays, where it lies."""
    made = mesh_of(arrays, given.materials, given.name, given.origin)
    return replace(
        made,
        coordinates=given.coordinates,
        rounding=given.rounding,
        cameras=given.cameras,
        extras=given.extras,
        tree=given.tree,
        source=given.source,
    )


def snap(mesh: Any, step: float) -> tuple[Mesh, float]:
    """The mesh with positions rounded to multiples of `step` (a power of two, in the mesh's
    unit), and the largest distance that a vertex moved."""
    given = as_mesh(mesh)
    positions, moved = _umbel.snap_to_grid(
        rows("positions", given.positions, 3), number("step", step)
    )
    return replace(given, positions=positions), moved


_PRECISION = re.compile(r"(?P<value>[0-9.eE+-]+)\s*(?P<unit>mm|bits?|)")


def parse_precision(precision: str) -> tuple[float, str]:
    """The number and the unit, "mm" or "bits", of a precision such as 0.1mm or 16bits. What has no
    unit is refused: 16 could be either."""
    match = _PRECISION.fullmatch(precision.strip())
    try:
        value = float(match["value"]) if match else math.nan
    except ValueError:
        value = math.nan
    if match is None or math.isnan(value):
        raise Error(
            f"precision must be a length such as 0.1mm or a number of bits such as 16bits, "
            f"not {precision!r}"
        )
    unit = match["unit"]
    if not unit:
        raise Error(
            f"precision {value:g} has no unit; write {value:g}mm for millimetres, or "
            f"{value:g}bits for steps over the longest side"
        )
    if unit == "mm":
        _check_length(value / 1000, precision)
    elif not (value.is_integer() and 1 <= value <= 24):
        raise Error(f"precision must be a whole number of bits from 1 to 24, not {value:g}")
    return value, "mm" if unit == "mm" else "bits"


def grid_step(mesh: Mesh, precision: str | float) -> float:
    """The power-of-two step that `precision` stands for on this mesh: a number is in the mesh's
    unit; "0.1mm" are millimetres where that unit is the metre; "16bits" are 2^16 steps over the
    longest side of the bounding box. A text without a unit is refused."""
    if isinstance(precision, str):
        value, unit = parse_precision(precision)
        if unit == "bits":
            return _step_of_bits(mesh, value)
        size = value / 1000
    else:
        size = float(precision)
        _check_length(size, precision)
    return 2.0 ** min(math.floor(math.log2(size)), 120)


def _check_length(size: float, precision: str | float) -> None:
    if not (math.isfinite(size) and size >= 2.0**-120):
        raise Error(
            f"precision {precision!r} is neither a length above zero, such as 0.1mm, "
            "nor a number of bits, such as 16bits"
        )


def _step_of_bits(mesh: Mesh, bits: float) -> float:
    box = _umbel.bounds(native(mesh))
    longest = float(np.max(np.subtract(box[1], box[0]))) if box else 0.0
    if not math.isfinite(longest):
        with about(mesh, DROPS):
            _umbel.validate(native(mesh))
    if longest <= 0:
        return 1.0
    return 2.0 ** max(-120, math.ceil(math.log2(longest / (2**bits - 1))))
