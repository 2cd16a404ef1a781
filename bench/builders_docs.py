"""Puts one run of `umbel bench bvh` into docs/builders.md and bench/results/builders-cpu.md: its
tables, and its charts as docs/images/builders-*.png.

    umbel bench bvh SCENES... --generated 4200000 --share 0.01 --threads 1 -o DIR
    python bench/builders_docs.py DIR
"""

from __future__ import annotations

import csv
import math
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from docs_tables import ROOT, fill, shrink, table

from umbel.bench.bvh import charts as bvh_charts

Row = dict[str, str]
SLIDES = ("sponza", "conference", "plant", "dragon")
"""Scenes whose charts are shown."""
SETTLING = ("sponza", "conference", "plant")
"""Those whose iterations are."""
FIELDS = {
    "sah": ("sah_ratio", 2, ".3f"),
    "epo": ("epo_ratio", 2, ".2f"),
    "build": ("mtriangles_per_second", 2, ".2f"),
    "speed2": ("speed_ratio", 2, ".2f"),
    "speed8": ("speed_ratio", 8, ".2f"),
    "lq2": ("lq_ratio", 2, ".2f"),
    "lq8": ("lq_ratio", 8, ".2f"),
    "hq2": ("hq_ratio", 2, ".2f"),
    "hq8": ("hq_ratio", 8, ".2f"),
}
"""Tables of builders by scenes: field, width, format."""
GUIDE = ("short answer", "cheapest", "speed8", "sweep", "scenes")
"""Tables of docs/builders.md, which shows hierarchies alone."""
GUIDE_ONLY = ("short answer", "cheapest", "sweep", "scenes")
"""Those that bench/results/builders-cpu.md, which has all structures, leaves out."""
OTHERS = ("kdtree", "grid", "octree", "bih")
"""How the names of other structures begin."""


def short(scene: str) -> str:
    """A scene's name in the tables."""
    return re.sub(r"^bench_|^littlest_|(_mri_iso)?_\d+k$|_dabrovic.*|_city$", "", scene)


def mean(values: Sequence[str]) -> float | None:
    """The geometric mean of what there is."""
    known = [float(value) for value in values if value]
    return math.exp(sum(map(math.log, known)) / len(known)) if known else None


def text(value: Any, form: str) -> str:
    return format(float(value), form) if value not in ("", None) else ""


def hierarchies(lines: str) -> str:
    """A table without the rows of other structures."""
    return "\n".join(
        line for line in lines.split("\n") if not line.removeprefix("| ").startswith(OTHERS)
    )


class Run:
    """The tables of a run, or of several on a scene each."""

    def __init__(self, *folders: Path) -> None:
        self.folders = folders
        self.rows = self._read("bvh.csv")
        self.scenes = list(dict.fromkeys(row["scene"] for row in self.rows))
        self.builders = list(dict.fromkeys(row["builder"] for row in self.rows))
        self._at = {(row["scene"], row["builder"], int(row["width"])): row for row in self.rows}

    def _read(self, name: str) -> list[Row]:
        rows = []
        for folder in self.folders:
            with (folder / name).open() as file:
                rows += list(csv.DictReader(file))
        return rows

    def of(self, builder: str, field: str, width: int) -> list[str]:
        """A figure of a builder on each scene."""
        return [self._at[scene, builder, width][field] for scene in self.scenes]

    def by_scene(self, field: str, width: int, form: str) -> str:
        """Builders by scenes."""
        lines = []
        for builder in self.builders:
            if builder == "sweep" and field.endswith("_ratio"):
                continue
            values = self.of(builder, field, width)
            lines.append([builder, *(text(v, form) for v in values), text(mean(values), form)])
        return table(["builder", *map(short, self.scenes), "mean"], lines)

    def scenes_table(self) -> str:
        lines = []
        for scene in self.scenes:
            row = next(r for r in self.rows if (r["scene"], r["builder"]) == (scene, "kmeans"))
            rays = f"{float(row['sample_rays']) * 1e-6:.1f} M"
            lines.append([short(scene), f"{int(row['triangles']):,}", row["kmeans"], rays])
        return table(["scene", "triangles", "k-means", "rays a sample of a picture"], lines)

    def short_answer(self) -> str:
        columns = {
            "M triangles/s": ("mtriangles_per_second", 8),
            "SAH cost": ("sah_ratio", 8),
            "EPO": ("epo_ratio", 8),
            "trace speed, width 8": ("speed_ratio", 8),
            "trace speed, width 2": ("speed_ratio", 2),
        }
        lines = [
            [builder, *(text(mean(self.of(builder, *how)), ".2f") for how in columns.values())]
            for builder in self.builders
        ]
        return table(["builder", *columns], lines)

    def sweep_speed(self) -> str:
        lines = [
            [f"{width} children per node", *(text(v, ".2f") for v in values)]
            for width in (2, 8)
            for values in [self.of("sweep", "mrays_per_second", width)]
        ]
        return table(["M rays/s", *map(short, self.scenes)], lines)

    def cheapest(self) -> str:
        found: dict[str, list[str]] = {}
        for row in self._read("bvh_cheapest.csv"):
            if row["width"] != "8":
                continue
            rays = float(row["from_mrays"])
            start = f"from {rays:.2g} " if rays else ""
            found.setdefault(row["scene"], []).append(start + row["builder"])
        return table(["scene", ""], [[short(s), ", ".join(f)] for s, f in found.items()])

    def stages(self) -> str:
        """Million triangles per second of each preset."""
        rows = self._read("bvh_stages.csv")
        presets = list(dict.fromkeys(row["preset"] for row in rows))
        lines = []
        for scene in self.scenes:
            triangles = int(self._at[scene, "sweep", 2]["triangles"])
            own = [row for row in rows if row["scene"] == scene]
            speeds = []
            for preset in presets:
                seconds = sum(float(row["seconds"]) for row in own if row["preset"] == preset)
                speeds.append(f"{triangles / seconds * 1e-6:.2f}")
            lines.append([short(scene), *speeds])
        return table(["M triangles/s", *presets], lines)

    def plant_stages(self) -> str:
        """Seconds of the stages of each preset on the plant."""
        rows = [row for row in self._read("bvh_stages.csv") if row["scene"] == "plant"]
        presets = list(dict.fromkeys(row["preset"] for row in rows))
        value = {(row["stage"], row["preset"]): float(row["seconds"]) for row in rows}
        lines = [
            [stage, *(f"{value[stage, preset]:.2f}" for preset in presets)]
            for stage in dict.fromkeys(row["stage"] for row in rows)
        ]
        return table(["seconds", *presets], lines)

    def settling(self) -> str:
        """What three iterations bring of what ten can, as published."""
        rows = [r for r in self._read("bvh_iterations.csv") if r["builder"] == "kmeans 2016"]
        counts = list(dict.fromkeys(int(row["clusters"]) for row in rows))
        lines = []
        for scene in self.scenes:
            cells = []
            for k in counts:
                costs = {
                    int(row["iterations"]): float(row["sah_cost"])
                    for row in rows
                    if row["scene"] == scene and int(row["clusters"]) == k
                }
                all_gain = costs[0] - min(costs.values())
                gain = (costs[0] - costs[3]) / all_gain if all_gain > 0 else 1.0
                cells.append(f"{costs[0]:.0f}, {costs[3]:.0f}, {costs[10]:.0f} ({gain:.0%})")
            lines.append([short(scene), *cells])
        return table(["SAH cost", *(f"k {k}" for k in counts)], lines)

    def texts(self) -> dict[str, str]:
        """All tables by name."""
        return {
            "short answer": self.short_answer(),
            "scenes": self.scenes_table(),
            "sweep": self.sweep_speed(),
            "cheapest": self.cheapest(),
            "presets": self.stages(),
            "stages": self.plant_stages(),
            "settling": self.settling(),
            **{name: self.by_scene(*how) for name, how in FIELDS.items()},
        }

    def charts(self, folder: Path) -> None:
        """Draws what the document shows."""
        for scene in self.scenes:
            name = short(scene)
            if name in SLIDES:
                own = [row for row in self.rows if (row["scene"], row["width"]) == (scene, "2")]
                self._draw(bvh_charts.draw_ratios, own, folder / f"builders-{name}.png")
            if name in SETTLING:
                own = [row for row in self._read("bvh_iterations.csv") if row["scene"] == scene]
                self._draw(
                    bvh_charts.draw_iterations, own, folder / f"builders-iterations-{name}.png"
                )
            if name == "plant":
                own = [row for row in self._read("bvh_stages.csv") if row["scene"] == scene]
                self._draw(bvh_charts.draw_stages, own, folder / "builders-stages.png")

    @staticmethod
    def _draw(draw: Callable[[Path, list[Any]], None], rows: list[Row], file: Path) -> None:
        draw(file, [{key: parsed(value) for key, value in row.items()} for row in rows])
        shrink(file, file)


def parsed(value: str) -> Any:
    """A cell of a CSV file: nothing, a whole number, a number or a text."""
    if value == "":
        return None
    for kind in (int, float):
        try:
            return kind(value)
        except ValueError:
            continue
    return value


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    run = Run(Path(sys.argv[1]))
    texts = run.texts()
    guide = {name: hierarchies(texts[name]) for name in GUIDE}
    fill(ROOT / "docs" / "builders.md", guide)
    results = {name: text for name, text in texts.items() if name not in GUIDE_ONLY}
    fill(ROOT / "bench" / "results" / "builders-cpu.md", results)
    run.charts(ROOT / "docs" / "images")


if __name__ == "__main__":
    main()
