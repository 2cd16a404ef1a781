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
from umbel.export.repeats import Repeat, Repeats
from umbel.export.source import Y_TO_Z, Source, copyright_of, material_list, source_name
from umbel.geometry.repair import Progress, stops
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
    flatten: bool = False,
    progress: Progress | None = None,
) -> LodGlbReport:
    """Writes an asset as one .glb of all its triangles and of coarser levels, each with a quarter
    of the triangles, by the extension MSFT_lod (docs/export.md). Everything is loaded at once: for
    assets of some millions of triangles.

    flatten: store each instance, for viewers without EXT_mesh_gpu_instancing.
    progress: called with (fraction, stage); returning False cancels (umbel.Cancelled).
    """
    asset = source if isinstance(source, Asset) else Asset(source)
    target = Path(path)
    if target.suffix.lower() != ".glb":
        raise Error(f"{target}: levels are written as .glb")
    made = Source(asset, "y")  # as the asset has them: glTF says nothing of other axes
    low, high = made.bounds()
    report = progress or (lambda *_: None)
    repeats = None if flatten else Repeats(made)
    grid = _grid(low, high)
    corner = np.minimum(grid.corner @ Y_TO_Z, (grid.corner + grid.side) @ Y_TO_Z)
    step = grid.side / _STEPS
    levels, errors = [], []
    for error, share in _errors(made, asset.path):
        if stops(report(share, "reading levels")):
            raise Cancelled("cancelled")
        several = repeats.of(np.arange(len(made.boxes)), error, corner, step) if repeats else []
        rest = np.ones(len(made.boxes), bool)
        for one in several:
            rest[one.instances] = False
        piece = made.whole(error, np.flatnonzero(rest))
        surface = None if piece is None else quantized(piece.turned(Y_TO_Z.T), corner, step)
        if surface is not None or several:
            levels.append(_Level(surface, several))
            errors.append(error)
    if not levels:
        raise Error(f"{asset.path}: all triangles are degenerate")
    coverages = _coverages(errors, float(np.linalg.norm(high - low)))
    chunks = _file(made, levels, coverages, corner, step, target.name)
    write_all(target, chunks)
    lost = made.losses(target)
    if lost:
        warn_lost(f"{target} was written without", lost, most=8)
    return LodGlbReport(
        bytes=sum(len(chunk) for chunk in chunks),
        levels=len(levels),
        triangles=[level.triangles for level in levels],
        errors=errors,
        coverages=coverages,
        largest_move=step * 3**0.5 / 2,
    )


@dataclass(frozen=True)
class _Level:
    surface: Quantized | None  #: all but what is drawn several times
    repeats: list[Repeat]

    def surfaces(self) -> list[Quantized]:
        own = [] if self.surface is None else [self.surface]
        return own + [repeat.surface for repeat in self.repeats]

    @property
    def triangles(self) -> int:
        own = 0 if self.surface is None else len(self.surface.triangles)
        return own + sum(repeat.triangles for repeat in self.repeats)


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
    levels: list[_Level],
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
    surfaces = [surface for level in levels for surface in level.surfaces()]
    if any(surface.materials is not None for surface in surfaces):
        table.write()
    title = source_name(source.asset)
    meshes: list[Json] = []
    nodes: list[Json] = [{} for _ in levels]
    for k, level in enumerate(levels):
        called, first = f"{title} {k}", len(meshes)
        for surface in level.surfaces():
            meshes.append({"name": called, "primitives": arrays.mesh(surface, table.number)})
        own = [] if level.surface is None else [grid_node(corner, step, mesh=first)]
        own += [r.node(arrays, first + len(own) + j, corner) for j, r in enumerate(level.repeats)]
        if level.repeats:
            nodes[k] = {"name": called, "children": [len(nodes) + j for j in range(len(own))]}
            nodes += own
        else:
            nodes[k] = {**own[0], "name": called}
    if lost:
        warn_lost(f"{name} has not all textures", list(dict.fromkeys(lost)))
    if len(levels) > 1:
        nodes[0]["extensions"] = {"MSFT_lod": {"ids": list(range(1, len(levels)))}}
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
