"""Streaming under a budget: a camera moves around an asset while its pages load over a link.

Time is simulated: 60 frames a second, and a line with a latency and a bandwidth. Each frame asks
for errors of one pixel; it is *near* if nothing that it shows is more than one pixel worse than
that.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from umbel.bench import charts
from umbel.bench.table import Row, columns, csv_text, markdown, write_tables
from umbel.bench.timing import Machine, Span, this_machine
from umbel.errors import Error
from umbel.geometry.camera import Camera
from umbel.geometry.repair import Progress
from umbel.lod.asset import Asset
from umbel.lod.residency import Residency

FRAMES_PER_SECOND = 60
BUDGETS = (0.05, 0.1, 0.25, 0.5)
"""Shares of the pages' bytes."""
LINES: dict[str, tuple[float, float, float, float]] = {
    "disk": (0.0002, 1e9, 0.0, 0.0),
    "network": (0.05, 20e6, 0.0, 0.0),
    "bad network": (0.05, 20e6, 0.05, 0.05),
}
"""Latency in seconds, bytes a second, shares of loads that fail and that are ten times as slow."""
ASPECT = 16 / 9
_NEAR = 2.0  # times the error asked for: one pixel, and one pixel worse

COLUMNS = columns(
    """
    asset              | asset
    line               | line
    budget             | budget          | .0%
    near               | near            | .2%
    frames_until_near  | first near      | d
    median_error       | median px       | .2f
    worst_error        | worst px        | .2f
    loaded_over_needed | loaded / needed | .2f
    needed             | needed          | .1%
    needed_at_once     | at once         | .1%
    reloads            | reloads         | d
    failures           | failures        | d
    mean_step_ms       | mean step ms    | .3f
    worst_step_ms      | worst step ms   | .3f
    """
)
LEGEND = (
    "A camera moves around the asset at 60 frames a second, 1080 pixels high, and asks for errors "
    "of one pixel. Near: frames in which nothing is more than one pixel worse than that; first "
    "near: frames until the first such. Loaded / needed: bytes of pages that came over bytes of "
    "the pages that some frame needed; at once: those that the neediest frame needs, as a share of "
    "all, and with a smaller budget it cannot be near. Steps are timed by the processor time that "
    "they took, loading apart."
)


@dataclass
class Comparison:
    """What `simulate` found."""

    machine: Machine
    rows: list[Row]
    frames: dict[tuple[str, str, float], list[float]]
    """The error of each frame in pixels, by asset, line and budget."""

    def fields(self) -> dict[str, Any]:
        """All of it, for JSON."""
        return {"rows": self.rows, "machine": self.machine.fields()}


def camera_path(asset: Asset, frames: int) -> Iterator[Camera]:
    """Round the asset's box in a minute, nearer and farther, looking past its middle ahead."""
    low, high = (np.array(corner, np.float64) for corner in asset.info["bounds"])
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    for frame in range(frames):
        turn = 2 * math.pi * frame / (60 * FRAMES_PER_SECOND)
        distance = size * (0.6 + 0.15 * math.sin(5 * turn))
        out = np.array([math.cos(turn), 0.25 * math.sin(3 * turn), math.sin(turn)])
        ahead = np.array([-math.sin(turn), 0.0, math.cos(turn)])
        eye, target = middle + distance * out, middle + 0.15 * size * ahead
        yield Camera(eye.tolist(), target=target.tolist())


def simulate(
    assets: Mapping[str, Callable[[], Asset]],
    *,
    seconds: float = 20.0,
    budgets: tuple[float, ...] = BUDGETS,
    lines: Mapping[str, tuple[float, float, float, float]] = LINES,
    progress: Progress | None = None,
) -> Comparison:
    """Walks about each asset over each line with each budget. A `progress` that returns False
    cancels."""
    found = Comparison(this_machine(), [], {})
    frames = max(int(seconds * FRAMES_PER_SECOND), 1)
    runs = len(assets) * len(lines) * len(budgets)
    for name, load in assets.items():
        asset = load()
        bounds = asset.info["bounds"]
        if bounds is None or bounds[0] == bounds[1]:
            raise Error(f"{name} has no extent to move a camera around")
        cameras = list(camera_path(asset, frames))
        needed = _needed(asset, cameras)
        for line, link in lines.items():
            for budget in budgets:
                done = len(found.rows)
                part = Span(progress, f"{name}, {line}, {budget:.0%}", done / runs, done / runs)
                part(0.0, "")
                errors, row = _run(asset, cameras, needed, link, budget)
                found.frames[name, line, budget] = errors
                found.rows.append({"asset": name, "line": line, "budget": budget, **row})
    return found


def _needed(asset: Asset, cameras: list[Camera]) -> tuple[set[int], int]:
    """The pages that some frame needs, where all come at once, and the most bytes of one frame."""
    ideal = Residency(
        asset,
        1 << 62,
        loads_in_flight=1 << 30,
        bytes_per_step=1 << 62,
        groups_per_step=(1 << 32) - 1,
        link=(0.0, 1e18, 0.0, 0.0),
    )
    pages: set[int] = set()
    sizes = asset.page_sizes
    most, now = 0, 0.0
    for camera in cameras:
        while ideal.step([camera], now, ASPECT)["missing_groups"]:
            now += 1e-6
        wanted = ideal.wanted_pages
        most = max(most, int(sizes[wanted].sum(dtype=np.int64)))
        pages.update(wanted.tolist())
        now += 1e-6
    return pages, most


def _run(
    asset: Asset,
    cameras: list[Camera],
    needed: tuple[set[int], int],
    link: tuple[float, float, float, float],
    share: float,
) -> tuple[list[float], Row]:
    sizes = asset.page_sizes.tolist()
    whole = sum(sizes)
    pinned = Residency(asset).statistics["pinned_bytes"]
    residency = Residency(asset, max(int(share * whole), pinned), link=link)
    errors, steps = [], []
    for frame, camera in enumerate(cameras):
        step = residency.step([camera], frame / FRAMES_PER_SECOND, ASPECT)
        errors.append(max(step["worst_error"], 1.0))
        steps.append(step["seconds"])
    near = [error <= _NEAR for error in errors]
    said = residency.statistics
    pages, most = needed
    needed_bytes = sum(sizes[p] for p in pages)
    return errors, {
        "near": sum(near) / len(near),
        "frames_until_near": near.index(True) if any(near) else None,
        "median_error": float(np.median(errors)),
        "worst_error": max(errors[FRAMES_PER_SECOND:] or errors),
        "loaded_over_needed": said["loaded_bytes"] / max(needed_bytes, 1),
        "needed": needed_bytes / whole,
        "needed_at_once": most / whole,
        "reloads": said["reloads"],
        "failures": said["failures"],
        "mean_step_ms": 1e3 * sum(steps) / len(steps),
        "worst_step_ms": 1e3 * max(steps),
    }


def stored(path: Path, allow_outside: bool = False) -> Asset:
    """An asset, or a mesh that is built at 16 bits first."""
    if path.suffix.lower() == ".umbel":
        return Asset(path)
    from umbel.lod.build import build_lod

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "asset.umbel"
        build_lod(path, precision="16bits", allow_outside=allow_outside).save(file)
        return Asset(file)


def blob() -> Asset:
    """Where no asset is named."""
    from umbel import shapes
    from umbel.lod.build import build_lod

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "asset.umbel"
        build_lod(shapes.blob(7), precision="16bits").save(file, page_bytes=16384)
        return Asset(file)


def report(found: Comparison) -> str:
    """The comparison as a Markdown document."""
    table = markdown(COLUMNS, found.rows)
    return "\n\n".join(["# Streaming", "\n".join(found.machine.sentences()), LEGEND, table])


def write(found: Comparison, folder: Path) -> list[Path]:
    """Writes the tables, and charts if matplotlib is there; the files written."""
    tables = {"stream.md": report(found), "stream.csv": csv_text(found.rows)}
    written = write_tables(folder, tables)
    if not charts.available():
        return written
    for asset in dict.fromkeys(row["asset"] for row in found.rows):
        path = folder / f"stream_{re.sub(r'[^A-Za-z0-9._-]', '_', asset)}.png"
        panels = []
        for line in dict.fromkeys(row["line"] for row in found.rows):
            series = [
                charts.Series(
                    f"budget {budget:.0%}",
                    [frame / FRAMES_PER_SECOND for frame in range(0, len(errors), 10)],
                    [max(errors[frame : frame + 10]) for frame in range(0, len(errors), 10)],
                    ours=True,
                )
                for (name, on, budget), errors in found.frames.items()
                if (name, on) == (asset, line)
            ]
            panels.append(charts.Panel(f"{asset}, {line}", series))
        charts.draw(path, panels, "seconds", "worst error in pixels", log_y=True)
        written.append(path)
    return written
