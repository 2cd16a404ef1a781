"""The charts of the comparison of hierarchies, after those of Meister & Bittner's slides."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.bench.table import Row
from umbel.replacing import replacing

GROUPS = {
    "speed_ratio": "trace speed",
    "sah_ratio": "SAH cost",
    "lq_ratio": "total time LQ",
    "hq_ratio": "total time HQ",
}
COLORS = {
    "kmeans": "#c0392b",
    "kmeans 2016": "#e6a197",
    "lbvh": "#2d6fb7",
    "hlbvh": "#3f9b57",
    "atrbvh 2015": "#f2cf9c",
    "atrbvh": "#e08e1b",
    "ploc 2018": "#c3b3d6",
    "ploc": "#7d5ba6",
    "hploc": "#4a2f73",
    "aac": "#8c6d4f",
    "agglomerative": "#d183b5",
    "insertion": "#17a2a8",
    "binned": "#9aa03a",
    "sbvh": "#4b4b4b",
    "best": "#111111",
}
_DPI = 100


def draw(
    folder: Path, rows: Sequence[Row], stages: Sequence[Row], iterations: Sequence[Row]
) -> list[Path]:
    """Draws all charts that there are rows for; the files written."""
    written = []
    for kind, (all_rows, draw_one) in {
        "ratios": (rows, draw_ratios),
        "stages": (stages, draw_stages),
        "iterations": (iterations, draw_iterations),
    }.items():
        groups: dict[tuple[str, int | None], list[Row]] = {}
        for row in all_rows:
            groups.setdefault((row["scene"], row.get("width")), []).append(row)
        for (scene, width), own in groups.items():
            path = _file(folder, scene, kind if width is None else f"width{width}")
            draw_one(path, own)
            written.append(path)
    return written


def draw_ratios(path: Path, rows: Sequence[Row]) -> None:
    """Bars that start at the full sweep's 1, in four groups; what is no hierarchy has its own scale
    and is left to the tables."""
    title = f"{rows[0]['scene']}: {rows[0]['triangles']:,} triangles"
    rows = sorted(
        (row for row in rows if row["builder"] in COLORS), key=lambda row: _rank(row["builder"])
    )
    figure, axes = _axes((10, 4.4))
    room = 0.84 / len(rows)
    for number, row in enumerate(rows):
        x = [group + (number - (len(rows) - 1) / 2) * room for group in range(len(GROUPS))]
        heights = [row[key] - 1 for key in GROUPS]
        axes.bar(x, heights, room * 0.9, 1, label=_label(row), color=COLORS[row["builder"]])
    axes.axhline(1, color="black", linewidth=0.8)
    axes.set_xticks(range(len(GROUPS)), list(GROUPS.values()))
    axes.tick_params(axis="x", length=0)
    axes.set_title(f"{title}; {rows[0]['width']} children a node", fontsize=11)
    axes.set_ylabel("relative to the full sweep\n(zero build time)")
    axes.grid(axis="y", alpha=0.3)
    figure.legend(loc="outside right upper", frameon=False)
    _save(figure, path)


def draw_stages(path: Path, rows: Sequence[Row]) -> None:
    """Stacked bars of the seconds of each preset, the stage that begins first at the bottom."""
    figure, axes = _axes((9, 4.4))
    presets = list(dict.fromkeys(row["preset"] for row in rows))
    bottom = dict.fromkeys(presets, 0.0)
    for number, stage in enumerate(dict.fromkeys(row["stage"] for row in rows)):
        seconds = {row["preset"]: row["seconds"] for row in rows if row["stage"] == stage}
        heights = [seconds.get(preset, 0.0) * 1000 for preset in presets]
        axes.bar(presets, heights, 0.6, list(bottom.values()), label=stage, color=f"C{number % 10}")
        for preset, height in zip(presets, heights, strict=True):
            bottom[preset] += height
    settings = {row["preset"]: row for row in rows}
    names = [
        f"{preset}\nk {row['clusters']}, p {row['candidates']}, i {row['iterations']}"
        for preset, row in settings.items()
    ]
    axes.set_xticks(range(len(presets)), names)
    axes.set_title(f"{rows[0]['scene']}: construction by k-means", fontsize=11)
    axes.set_ylabel("time [ms]")
    axes.grid(axis="y", alpha=0.3)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside right upper", frameon=False)
    _save(figure, path)


def draw_iterations(path: Path, rows: Sequence[Row]) -> None:
    """Lines of the SAH cost against iterations, one for each k."""
    figure, axes = _axes((9, 4.4))
    seeded = list(dict.fromkeys((row["clusters"], row["candidates"]) for row in rows))
    for variant, (line, dot) in {"kmeans 2016": ("-", "o"), "kmeans": (":", ".")}.items():
        for number, key in enumerate(seeded):
            own = [
                row
                for row in rows
                if (row["clusters"], row["candidates"]) == key and row["builder"] == variant
            ]
            axes.plot(
                [row["iterations"] for row in own],
                [row["sah_cost"] for row in own],
                linestyle=line,
                marker=dot,
                color=f"C{number}",
                label=f"{variant}, k = {key[0]}, p = {key[1]}",
            )
    axes.axhline(rows[0]["sweep"], color="black", linestyle="--", linewidth=1, label="full sweep")
    axes.set_title(f"{rows[0]['scene']}: SAH cost of k-means", fontsize=11)
    axes.set(xlabel="iterations", ylabel="SAH cost (traversal 3, intersection 2)")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside right upper", frameon=False)
    _save(figure, path)


def save_previews(folder: Path, previews: Mapping[str, NDArray[np.uint8]]) -> list[Path]:
    """Writes grey pictures; the files written."""
    from PIL import Image

    written = []
    for scene, grey in previews.items():
        path = _file(folder, scene, "views")
        with replacing(path) as file:
            Image.fromarray(grey).quantize(64).save(file, "PNG", optimize=True)
        written.append(path)
    return written


def _file(folder: Path, scene: str, kind: str) -> Path:
    stem = re.sub(r"[^A-Za-z0-9._-]", "_", scene)
    return folder / f"bvh_{stem}_{kind}.png"


def _rank(builder: str) -> int:
    """The builders of the slides first, then the others as their colours are listed."""
    return list(COLORS).index(builder)


def _label(row: Row) -> str:
    return row["builder"] if row["kmeans"] is None else f"{row['builder']}\n({row['kmeans']})"


def _axes(size: tuple[float, float]) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots()
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.set_axisbelow(True)
    return figure, axes


def _save(figure: Any, path: Path) -> None:
    with replacing(path) as file:
        figure.savefig(file, format="png", dpi=_DPI)
