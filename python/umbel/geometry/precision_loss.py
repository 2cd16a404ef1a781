"""What rounding to float32 or to a grid costs a mesh: a warning, or an error if it is too much."""

from __future__ import annotations

import warnings

import numpy as np

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import Rounding, rounding_loss, zero_origin

_MOST_COLLAPSED = 0.01
"""The share of a mesh's triangles that may lose their area before a build refuses."""
_MOST_MOVED = 0.01
"""How far rounding may move a vertex without a word, in typical edges."""
_SAMPLE = 10_000


def refuse_collapse(mesh: Mesh, step: float | None) -> None:
    """Raises if too many triangles lost their area when the mesh was read into float32, or would on
    a grid of this step."""
    total = len(mesh.triangles)
    refuse_lost_area(mesh.rounding, total, _named(mesh))
    if step is None:
        return
    snapped, moved = _umbel.snap_to_grid(mesh.positions, step)
    lost = rounding_loss(mesh.positions, zero_origin(), snapped, mesh.triangles)
    if lost.degenerate > _MOST_COLLAPSED * total:
        raise Error(
            f"{_named(mesh)}a grid of {step:.3g} would take the area of {lost.degenerate} of "
            f"{total} triangles and move vertices by up to {moved:.3g}: use a finer precision, "
            f"or build it as it is with force"
        )


def refuse_lost_area(lost: Rounding, triangles: int, where: str) -> None:
    """Raises if too many of so many triangles lost their area as a mesh was read into float32."""
    if lost.degenerate > _MOST_COLLAPSED * triangles:
        raise Error(
            f"{where}{lost.degenerate} of {triangles} triangles lost their area when positions "
            f"were rounded to 32-bit floats, which moved vertices by up to "
            f"{lost.largest_move:.3g}: the mesh is too large for its finest details; build parts "
            f"of it that lie closer together, keep its instances apart, or build it as it is with "
            f"force"
        )


def warn_of_rounding(mesh: Mesh) -> None:
    """Says where reading into float32 moved vertices by more than their triangles can hide."""
    moved = mesh.rounding.largest_move
    if moved > 0 and (mesh.rounding.degenerate or moved > _MOST_MOVED * _typical_edge(mesh)):
        warnings.warn(
            f"{_named(mesh)}positions were rounded to 32-bit floats, which moved vertices by up to "
            f"{moved:.3g} and took the area of {mesh.rounding.degenerate} triangles: parts of the "
            f"mesh lie too far apart for its finest details",
            LoadWarning,
            stacklevel=3,
        )


def _typical_edge(mesh: Mesh) -> float:
    """The median length of edges that have one, of some triangles."""
    every = max(len(mesh.triangles) // _SAMPLE, 1)
    some = mesh.triangles[::every]
    some = some[(some < len(mesh.positions)).all(axis=1)]
    corners = mesh.positions[some].astype(np.float64)
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).reshape(-1)
    lengths = lengths[np.isfinite(lengths) & (lengths > 0)]
    return float(np.median(lengths)) if len(lengths) else 0.0


def _named(mesh: Mesh) -> str:
    name = mesh.source or mesh.name
    return f"{name}: " if name else ""
