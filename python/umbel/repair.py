"""What is done to a mesh before anything else: checking, repairing, welding, snapping."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from . import _umbel
from .arrays import as_mesh, mesh_of, native, rows, thread_count
from .errors import Error
from .mesh import Mesh

Progress = Callable[[float, str], "bool | None"]


def validate(mesh: Any, *, progress: Progress | None = None, threads: int = 0) -> None:
    """Raises umbel.Error naming the first triangle whose index is out of range, or the first
    vertex in use that is NaN or infinite. Degenerate and duplicate triangles are legal."""
    _umbel.validate(native(as_mesh(mesh)), progress, thread_count(threads))


def drop_invalid(
    mesh: Any, *, progress: Progress | None = None, threads: int = 0
) -> tuple[Mesh, int]:
    """The mesh without the triangles that `validate` would reject, and how many those were."""
    given = as_mesh(mesh)
    arrays, dropped = _umbel.drop_invalid(native(given), progress, thread_count(threads))
    return mesh_of(arrays, given.materials, given.name), dropped


def weld(mesh: Any, *, progress: Progress | None = None, threads: int = 0) -> Mesh:
    """The mesh with vertices of equal position, attributes and material made one, and those that
    no triangle uses removed. Triangles keep their order and their corners'."""
    given = as_mesh(mesh)
    arrays = _umbel.weld(native(given), progress, thread_count(threads))
    return mesh_of(arrays, given.materials, given.name)


def snap(mesh: Any, step: float) -> tuple[Mesh, float]:
    """The mesh with positions rounded to multiples of `step` (a power of two, in the mesh's
    unit), and the largest distance that a vertex moved."""
    given = as_mesh(mesh)
    positions, moved = _umbel.snap_to_grid(rows("positions", given.positions, 3), step)
    return replace(given, positions=positions), moved


_PRECISION = re.compile(r"(?P<value>[0-9.eE+-]+)\s*(?P<unit>mm|bits?|)")


def grid_step(mesh: Mesh, precision: str | float) -> float:
    """The power-of-two step that `precision` stands for on this mesh: a number is in the mesh's
    unit; "0.1mm" or "0.1" are millimetres where that unit is the metre; "16bits" are 2^16 steps
    over the longest side of the bounding box."""
    if isinstance(precision, str):
        match = _PRECISION.fullmatch(precision.strip())
        try:
            value = float(match["value"]) if match else math.nan
        except ValueError:
            value = math.nan
        unit = match["unit"] if match else ""
        if unit.startswith("bit"):
            return _step_of_bits(mesh, value)
        size = value / 1000
    else:
        size = float(precision)
    if not (math.isfinite(size) and size >= 2.0**-120):
        raise Error(
            f"precision {precision!r} is neither a length above zero, such as 0.1mm, "
            "nor a number of bits, such as 16bits"
        )
    return 2.0 ** min(math.floor(math.log2(size)), 120)


def _step_of_bits(mesh: Mesh, bits: float) -> float:
    if not (bits == int(bits if math.isfinite(bits) else 0) and 1 <= bits <= 24):
        raise Error(f"precision: {bits:g} bits is not a whole number from 1 to 24")
    box = _umbel.bounds(native(mesh))
    longest = float(np.max(np.subtract(box[1], box[0]))) if box else 0.0
    if longest <= 0:
        return 1.0
    return 2.0 ** max(-120, math.ceil(math.log2(longest / (2**bits - 1))))
