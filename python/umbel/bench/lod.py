"""Levels of detail beside meshoptimizer's clusterlod.h: how far cuts of equally many triangles are
from the mesh, in both directions, in distance, normals and texture coordinates.

Points are spread over both surfaces evenly by area and looked up on the other one, through our
hierarchies. A normal is interpolated between vertices where there are normals, else the triangle's.
Coverage, which is what foliage must keep, is counted in pixels from eight directions.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import shapes
from umbel.accel.bvh import Bvh
from umbel.bench import charts
from umbel.bench.peers import clusterlod_cuts, has_clusterlod
from umbel.bench.table import Column, Row, columns, csv_text, markdown, write_tables
from umbel.bench.timing import Machine, Span, this_machine
from umbel.errors import Error
from umbel.geometry.arrays import native
from umbel.geometry.mesh import Mesh, normalized
from umbel.geometry.repair import Progress, validate, weld
from umbel.lod.build import build_lod
from umbel.lod.lod import Lod

FRACTIONS = (0.1, 0.01, 0.001)
PEER = "clusterlod.h"
PEERS = {PEER: False, f"{PEER}, ray tracing": True}
"""Settings of clusterlod.h: whether those for ray tracing, spatial clusters of 256 vertices."""
MEASURES = ("mean_distance", "max_distance", "normal_degrees", "uv_error")
PIXELS = 160
"""Of a side of the pictures that coverage is counted in."""
COLUMNS = columns(
    """
    mesh           | mesh
    method         | method
    share          | share     | .3%
    triangles      | triangles | ,d
    mean_distance  | mean      | .2f
    max_distance   | max       | .1f
    normal_degrees | normals   | .3f
    uv_error       | UVs       | .3f
    coverage       | covered   | .3f
    seconds        | seconds   | .3f
    """
)
RATIOS = [
    Column("peer", "beside"),
    Column("share", "share", ".3%"),
    *(
        Column(name, title, ".3f")
        for name, title in zip(MEASURES, ("mean", "max", "normals", "UVs"), strict=True)
    ),
    Column("better", "better", "d"),
    Column("compared", "of", "d"),
]
LEGEND = (
    "Cuts of exactly as many triangles as clusterlod.h's with at most that share of the mesh's, by "
    "its default settings and by those for ray tracing: ours are interpolated between the nearest "
    "below and above, logarithms over logarithms. clusterlod.h takes one material, so neither is "
    "told of any. "
    "Distances are in millionths of the mesh's diagonal, to the mesh and back: the mean of both "
    "directions and the larger maximum; normals in degrees and texture coordinates in thousandths, "
    "means of both directions. Covered: pixels of the silhouettes from eight directions, as a part "
    "of the mesh's. Seconds: processor time of the build on one thread."
)

PROCEDURAL: dict[str, Callable[[], Mesh]] = {
    "blob": lambda: shapes.blob(6),
    "terrain": lambda: shapes.terrain(200, 200),
}
"""The meshes to compare on where none are given."""


@dataclass
class Comparison:
    """What was measured, on which machine."""

    machine: Machine
    rows: list[Row] = field(default_factory=list)

    @property
    def ratios(self) -> list[Row]:
        """Geometric means over the meshes of ours divided by clusterlod.h's; below 1 is better."""
        found = []
        cases = [(r["beside"], r["share"]) for r in self.rows if r.get("beside")]
        for peer, share in dict.fromkeys(cases):
            there = [r for r in self.rows if r["share"] == share]
            ours = [r for r in there if r.get("beside") == peer]
            theirs = [r for r in there if r["method"] == peer]
            out: Row = {"peer": peer, "share": share, "better": 0, "compared": 0}
            for name in MEASURES:
                pairs = [
                    (a[name], b[name])
                    for a, b in zip(ours, theirs, strict=True)
                    if a.get(name) and b.get(name)
                ]
                if pairs:
                    out[name] = float(np.exp(np.mean([np.log(a / b) for a, b in pairs])))
                    out["better"] += sum(a < b for a, b in pairs)
                    out["compared"] += len(pairs)
            found.append(out)
        return found

    def fields(self) -> dict[str, Any]:
        """For JSON."""
        return {"rows": self.rows, "ratios": self.ratios, "machine": self.machine.fields()}


def compare(
    meshes: Mapping[str, Callable[[], Mesh]],
    *,
    samples: int = 50_000,
    progress: Progress | None = None,
) -> Comparison:
    """Builds and measures each mesh, loaded one at a time. A `progress` that returns False
    cancels."""
    found = Comparison(this_machine())
    for number, (name, load) in enumerate(meshes.items()):
        mesh = load()
        validate(mesh)
        mesh = weld(replace(mesh, material_ids=None))
        if not len(mesh.triangles):
            raise Error(f"{name} has no triangles to simplify")
        part = Span(progress, name, number / len(meshes), (number + 1) / len(meshes))
        found.rows += _rows(name, mesh, samples, part)
    return found


def _rows(name: str, mesh: Mesh, samples: int, report: Callable[[float, str], None]) -> list[Row]:
    shares = [f for f in FRACTIONS if f * len(mesh.triangles) >= 200] or [FRACTIONS[0]]
    budgets = [int(f * len(mesh.triangles)) for f in shares]
    source = _Surface(mesh, samples)
    rows: list[Row] = []
    wanted = [] if has_clusterlod() else list(zip(shares, budgets, [""] * 3, strict=False))
    for peer, ray_tracing in PEERS.items() if has_clusterlod() else ():
        report(0.15 * ray_tracing, peer)
        values, weights = _attributes(mesh)
        cuts, seconds = clusterlod_cuts(native(mesh), values, weights, budgets, ray_tracing)
        for share, triangles in zip(shares, cuts, strict=True):
            cut = _with_triangles(mesh, triangles)
            wanted.append((share, len(cut.triangles), peer))
            row = _row(name, peer, share, seconds, len(cut.triangles))
            rows.append(row | source.compare(_Surface(cut, samples)))
    report(0.3, "umbel")
    began = time.thread_time()
    lod = build_lod(mesh, threads=1)
    seconds = time.thread_time() - began
    for i, (share, budget, beside) in enumerate(wanted):
        report(0.5 + 0.5 * i / len(wanted), "measuring")
        row = _row(name, "umbel", share, seconds, budget) | {"beside": beside}
        rows.append(
            row | _at_budget(lod, budget, lambda cut: source.compare(_Surface(cut, samples)))
        )
    return sorted(rows, key=lambda row: -row["share"])


def _row(mesh: str, method: str, share: float, seconds: float, triangles: int) -> Row:
    return {
        "mesh": mesh,
        "method": method,
        "share": share,
        "seconds": seconds,
        "triangles": triangles,
    }


def _at_budget(
    lod: Lod, budget: int, measure: Callable[[Mesh], dict[str, float]]
) -> dict[str, float]:
    """What a cut of exactly so many triangles would measure: between the largest cut below and the
    smallest above, logarithms of measures over the logarithm of triangles."""
    below = lod.cut(triangles=budget, or_coarsest=True)
    measured = measure(lod.mesh(below))
    count = _count(lod, below)
    errors = np.unique(lod.groups["error"])
    above = [lod.cut(error=float(e)) for e in _first_above(lod, errors, budget)]
    if count >= 0.98 * budget or not above:
        return measured
    richer = measure(lod.mesh(above[0]))
    part = math.log(budget / count) / math.log(_count(lod, above[0]) / count)
    return {
        key: math.exp((1 - part) * _log(value) + part * _log(richer[key]))
        for key, value in measured.items()
    }


def _first_above(lod: Lod, errors: NDArray[np.float32], budget: int) -> list[float]:
    """The largest of the errors whose cut has more triangles than that, if any has."""
    low, high = 0, int(np.isfinite(errors).sum())
    while low < high:
        middle = (low + high) // 2
        if _count(lod, lod.cut(error=float(errors[middle]))) > budget:
            low = middle + 1
        else:
            high = middle
    return [float(errors[low - 1])] if low else []


def _count(lod: Lod, cut: NDArray[np.uint32]) -> int:
    return int(lod.clusters["triangle_count"][cut].sum())


def _log(value: float) -> float:
    return math.log(max(value, 1e-12))


def _attributes(mesh: Mesh) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What our build weighs, with the weight that clusterlod.h's own demo gives to normals."""
    parts = [a for a in (mesh.normals, mesh.uvs, mesh.colors) if a is not None]
    if not parts:
        return np.empty((len(mesh.positions), 0), np.float32), np.empty(0, np.float32)
    values = np.ascontiguousarray(np.hstack(parts), np.float32)
    return values, np.full(values.shape[1], 0.5, np.float32)


def _with_triangles(mesh: Mesh, triangles: NDArray[np.uint32]) -> Mesh:
    return Mesh(mesh.positions, triangles.reshape(-1, 3), normals=mesh.normals, uvs=mesh.uvs)


class _Surface:
    """A mesh with points spread over it."""

    def __init__(self, mesh: Mesh, samples: int) -> None:
        random = np.random.default_rng(1)
        self.mesh = mesh
        self.bvh = Bvh(mesh.positions, mesh.triangles)
        corners = mesh.positions[mesh.triangles].astype(np.float64)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.face_normals = normalized(cross)
        areas = np.linalg.norm(cross, axis=1)
        total = areas.sum()
        if not total > 0:
            raise Error("a mesh without area has no distances to measure")
        at = (np.arange(samples) + random.uniform(size=samples)) / samples * total
        self.triangle = np.minimum(np.searchsorted(np.cumsum(areas), at), len(areas) - 1)
        u, v = random.uniform(size=(2, samples))
        over = u + v > 1
        u[over], v[over] = 1 - u[over], 1 - v[over]
        self.uv = np.stack([u, v], axis=1)
        self.points = self.value(mesh.positions, self.triangle, self.uv)
        used = corners.reshape(-1, 3)
        low, high = used.min(axis=0), used.max(axis=0)
        self.middle, self.diagonal = (low + high) / 2, float(np.linalg.norm(high - low))

    def value(
        self, stream: NDArray[np.float32], triangle: NDArray[Any], uv: NDArray[Any]
    ) -> NDArray[np.float64]:
        corners = stream[self.mesh.triangles[triangle]].astype(np.float64)
        u, v = uv[:, :1], uv[:, 1:]
        weights = np.stack([1 - u - v, u, v], axis=1)
        mixed: NDArray[np.float64] = (corners * weights).sum(axis=1)
        return mixed

    def normal(self, triangle: NDArray[Any], uv: NDArray[Any]) -> NDArray[np.float64]:
        if self.mesh.normals is None:
            return np.asarray(self.face_normals[triangle], np.float64)
        return np.asarray(normalized(self.value(self.mesh.normals, triangle, uv)), np.float64)

    def to(self, other: _Surface) -> dict[str, float]:
        """From the points of this one to the other."""
        found = other.bvh.closest_point(self.points.astype(np.float32))
        triangle = found.primitive.astype(np.int64)
        uv = np.stack([found.u, found.v], axis=1).astype(np.float64)
        cosines = (self.normal(self.triangle, self.uv) * other.normal(triangle, uv)).sum(axis=1)
        out = {
            "mean_distance": float(found.distance.mean(dtype=np.float64)),
            "max_distance": float(found.distance.max()),
            "normal_degrees": float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean()),
        }
        if self.mesh.uvs is not None and other.mesh.uvs is not None:
            own = self.value(self.mesh.uvs, self.triangle, self.uv)
            there = other.value(other.mesh.uvs, triangle, uv)
            out["uv_error"] = float(np.linalg.norm(own - there, axis=1).mean()) * 1e3
        return out

    def covered(self, around: _Surface) -> int:
        """Pixels that it covers, of parallel views that hold all of another one."""
        steps = ((np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1) * around.diagonal / 2
        x, y = (axis.reshape(-1, 1) for axis in np.meshgrid(steps, steps))
        count = 0
        for turn in np.arange(8) * (np.pi / 4):
            along = normalized(np.array([[np.cos(turn), 0.3, np.sin(turn)]]))[0]
            right = normalized(np.cross(along, [[0.0, 1.0, 0.0]]))[0]
            origins = around.middle - along * around.diagonal + x * right
            origins = (origins + y * np.cross(right, along)).astype(np.float32)
            directions = np.broadcast_to(along.astype(np.float32), origins.shape)
            hits = self.bvh.intersect(origins, np.ascontiguousarray(directions))
            count += int(np.isfinite(hits.t).sum())
        return count

    def compare(self, other: _Surface) -> dict[str, float]:
        """Both directions together, and what the other one covers."""
        there, back = self.to(other), other.to(self)
        out = {key: (there[key] + back[key]) / 2 for key in there}
        out["max_distance"] = max(there["max_distance"], back["max_distance"])
        for key in ("mean_distance", "max_distance"):
            out[key] *= 1e6 / self.diagonal
        out["coverage"] = other.covered(self) / max(self.covered(self), 1)
        return out


def report(found: Comparison) -> str:
    """The comparison as a Markdown document."""
    parts = [
        "# Levels of detail",
        "\n".join(found.machine.sentences()),
        LEGEND,
        markdown(COLUMNS, found.rows).rstrip(),
    ]
    if found.ratios:
        parts += [
            "Ours divided by clusterlod.h's, geometric means over the meshes, and how many of the "
            "single measurements are better:",
            markdown(RATIOS, found.ratios),
        ]
    return "\n\n".join(parts)


def write(found: Comparison, folder: Path) -> list[Path]:
    """Writes the tables, and charts if matplotlib is there; the files written."""
    tables = {"lod.md": report(found), "lod.csv": csv_text(_same_fields(found.rows))}
    written = write_tables(folder, tables)
    if not charts.available():
        return written
    for mesh in dict.fromkeys(row["mesh"] for row in found.rows):
        path = folder / f"lod_{re.sub(r'[^A-Za-z0-9._-]', '_', mesh)}.png"
        charts.draw(path, [_panel(mesh, found.rows)], "triangles", "mean distance", log_x=True)
        written.append(path)
    return written


def _same_fields(rows: list[Row]) -> list[Row]:
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [{name: row.get(name) for name in names} for row in rows]


def _panel(mesh: str, rows: list[Row]) -> charts.Panel:
    series = []
    for method in dict.fromkeys(row["method"] for row in rows):
        points = [r for r in rows if r["mesh"] == mesh and r["method"] == method]
        series.append(
            charts.Series(
                method,
                [r["triangles"] for r in points],
                [r["mean_distance"] for r in points],
                ours=method == "umbel",
            )
        )
    return charts.Panel(mesh, series)


__all__ = ["COLUMNS", "PROCEDURAL", "RATIOS", "Comparison", "compare", "report", "write"]
