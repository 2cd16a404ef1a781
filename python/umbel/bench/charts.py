"""Charts as PNG files. Needs matplotlib, which the extra `umbel[bench]` installs."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from umbel.replacing import replacing

WITHOUT = "no charts: matplotlib is missing; `pip install 'umbel[bench]'` brings it"


@dataclass(frozen=True)
class Series:
    """Points of one method, joined by a line where there are several."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    ours: bool


@dataclass(frozen=True)
class Panel:
    """One set of axes."""

    title: str
    series: Sequence[Series]


def available() -> bool:
    """Whether matplotlib is there."""
    return importlib.util.find_spec("matplotlib") is not None


def draw(
    path: Path,
    panels: Sequence[Panel],
    x_label: str,
    y_label: str,
    *,
    log_x: bool = False,
    log_y: bool = False,
) -> None:
    """Draws the panels beside each other, up to three in a row, with one legend."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    columns = min(len(panels), 3)
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(2.5 + 4 * columns, 4 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).flatten()
    colors: dict[str, str] = {}
    lines = {}
    for axes, panel in zip(grid, panels, strict=False):
        for series in panel.series:
            color = colors.setdefault(series.name, f"C{len(colors) % 10}")
            marker, line = "o" if series.ours else "s", "-" if len(series.x) > 1 else "none"
            (lines[series.name],) = axes.plot(
                series.x, series.y, marker=marker, linestyle=line, color=color
            )
        axes.set(title=panel.title, xlabel=x_label, ylabel=y_label)
        if log_x:
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axes.xaxis.set_minor_locator(NullLocator())
        if log_y:
            axes.set_yscale("log")
        axes.grid(alpha=0.3)
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    figure.legend(list(lines.values()), list(lines), loc="outside right upper")
    with replacing(path) as file:
        figure.savefig(file, format="png", dpi=100)
