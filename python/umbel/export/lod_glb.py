"""A small asset as one .glb with a few levels: MSFT_lod with screen coverages."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from umbel.errors import Cancelled, Error, warn_lost
from umbel.export.glb import glb_bytes, grid_node
from umbel.export.packed import Json, PackedArrays, Quantized, quantized
from umbel.export.piece import Doubles
from umbel.export.plan import Grid
from umbel.export.source import Y_TO_Z, Source, copyright_of, material_list, source_name
from umbel.geometry.repair import Progress
from umbel.io.files import write_all
from umbel.io.gltf.material_table import MaterialTable
from umbel.lod.asset import Asset

MOST_TRIANGLES = 16_000_000
_FEWEST_TRIANGLES = 256
_RATIO = 4
_STEPS = 2**16
_HEIGHT = 1080
"""A level is shown while the next coarser one would be wrong by over a pixel of so many."""


@dataclass(frozen=True)
class LodGlbReport:
    """What was written."""

    bytes: int
    levels: int
    triangles: list[int]  #: of each level, the finest first
    errors: list[float]
    coverages: list[float]  #: the least share of the screen that each level is for
    largest_move: float  #: of a vertex, as positions are rounded


def export_glb(
    source: Asset | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    progress: Progress | None = None,
) -> LodGlbReport:
    """Writes an asset as one .glb of all its triangles and of coarser levels, each with a quarter
    of the triangles, by the extension MSFT_lod (docs/export.md). Everything is loaded at once: for
    assets of some millions of triangles.

    progress: called with (fraction, stage); returning False cancels (umbel.Cancelled).
    """
    asset = source if isinstance(source, Asset) else Asset(source)
    target = Path(path)
    if target.suffix.lower() != ".glb":
        raise Error(f"{target}: levels are written as .glb")
    made = Source(asset, "y")  # as the asset has them: glTF says nothing of other axes
    low, high = made.bounds()
    report = progress or (lambda *_: None)
    levels = []
    for error, share in _errors(made, asset.path):
        if report(share, "reading levels") is False:
            raise Cancelled("cancelled")
        levels.append((error, made.cut(error, low, high)))
    grid = _grid(low, high)
    surfaces, errors = [], []
    for error, piece in levels:
        corner = np.minimum(grid.corner @ Y_TO_Z, (grid.corner + grid.side) @ Y_TO_Z)
        surface = (
            None if piece is None else quantized(piece.turned(Y_TO_Z.T), corner, grid.side / _STEPS)
        )
        if surface is not None:
            surfaces.append(surface)
            errors.append(error)
    if not surfaces:
        raise Error(f"{asset.path}: all triangles are degenerate")
    coverages = _coverages(errors, float(np.linalg.norm(high - low)))
    chunks = _file(made, surfaces, coverages, corner, grid.side / _STEPS, target.name)
    write_all(target, chunks)
    return LodGlbReport(
        bytes=sum(len(chunk) for chunk in chunks),
        levels=len(surfaces),
        triangles=[len(surface.triangles) for surface in surfaces],
        errors=errors,
        coverages=coverages,
        largest_move=grid.side / _STEPS * 3**0.5 / 2,
    )


def _errors(source: Source, path: str) -> list[tuple[float, float]]:
    """The error of each level, and how far the work is then."""
    most = sum(int(counts.sum()) for _, counts in source.cluster_boxes(0.0))
    if most > MOST_TRIANGLES:
        raise Error(
            f"{path}: {most:,} triangles are too many for one .glb, which viewers load whole: at "
            f"most {MOST_TRIANGLES:,}; export 3D Tiles"
        )
    errors, count = [0.0], most // _RATIO
    while count >= _FEWEST_TRIANGLES:
        error = source.error_for(count)
        if error > errors[-1]:
            errors.append(error)
        count //= _RATIO
    return [(error, k / len(errors)) for k, error in enumerate(errors)]


def _grid(low: Doubles, high: Doubles) -> Grid:
    """A cube whose last step nothing reaches, as the largest integer is one short of it."""
    around = Grid.around(low, high)
    return Grid.around(low, high + around.side * 2.0**-15)


def _coverages(errors: list[float], size: float) -> list[float]:
    """The least share of the screen's area for each level: that at which the next coarser level has
    an error of one pixel. The coarsest is never hidden."""
    shares = [min(1.0, size / (error * _HEIGHT)) ** 2 for error in errors[1:]]
    return [*shares, 0.0]


def _file(
    source: Source,
    surfaces: list[Quantized],
    coverages: list[float],
    corner: Doubles,
    step: float,
    name: str,
) -> list[bytes]:
    arrays = PackedArrays()
    lost: list[str] = []
    table = MaterialTable(
        lambda data, _: {"bufferView": arrays.blob(data)}, material_list(source), lost
    )
    if any(surface.materials is not None for surface in surfaces):
        table.write()
    if lost:
        warn_lost(f"{name} has not all textures", list(dict.fromkeys(lost)))
    title = source_name(source.asset)
    meshes = [
        {"name": f"{title} {k}", "primitives": arrays.mesh(surface, table.number)}
        for k, surface in enumerate(surfaces)
    ]
    nodes: list[Json] = [
        grid_node(corner, step, mesh=k, name=mesh["name"]) for k, mesh in enumerate(meshes)
    ]
    if len(nodes) > 1:
        nodes[0]["extensions"] = {"MSFT_lod": {"ids": list(range(1, len(nodes)))}}
        nodes[0]["extras"] = {"MSFT_screencoverage": coverages}
    roots = [0]
    origin = source.asset.origin
    if origin.any():
        nodes.append({"translation": origin.tolist(), "children": [0]})
        roots = [len(nodes) - 1]
    scene = {
        "asset": copyright_of(source.asset),
        "roots": roots,
        "nodes": nodes,
        "meshes": meshes,
    }
    return glb_bytes(arrays, table, scene, name=name)
