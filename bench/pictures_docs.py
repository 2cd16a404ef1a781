"""Puts runs of `umbel bench bvh` on whole pictures, a folder a scene, into docs/builders.md and
bench/results/builders-pictures-cpu.md: their tables, and charts as docs/images/pictures-*.png.

    umbel bench bvh SCENE --share 1 --samples 128 --resolution 128x96 --width 8 --threads 1 \\
      --part builders --builder NAME... -o DIR
    python bench/pictures_docs.py DIR...
"""

from __future__ import annotations

import sys
from pathlib import Path

from builders_docs import Run, mean, parsed, short, text
from docs_tables import ROOT, fill, shrink, table

from umbel.bench.bvh import charts as bvh_charts
from umbel.bench.bvh.totals import HQ

WIDTH = 8
PIXELS = 64
"""How many times as many a picture of 1024 x 768 has."""
SOURCE = "whole pictures"
FIELDS = {
    "build": ("build_seconds", ".3f"),
    "sah": ("sah_ratio", ".3f"),
    "epo": ("epo_ratio", ".2f"),
    "speed": ("speed_ratio", ".3f"),
    "lq": ("lq_ratio", ".3f"),
    "hq": ("hq_ratio", ".3f"),
    "lq seconds": ("lq_seconds", ".2f"),
    "hq seconds": ("hq_seconds", ".2f"),
}
"""Tables of builders by scenes: field, format."""
CHARTS = ("sponza", "conference", "plant")
"""Scenes that the slides have charts of."""


def at_full_size(run: Run, builder: str) -> list[str]:
    """Total times of pictures of 1024 x 768 with 128 samples per pixel, relative to those of the
    full sweep without its build, in proportion to the pixels."""
    found = []
    rows = {(row["scene"], row["builder"]): row for row in run.rows}
    for scene in run.scenes:
        row, sweep = rows[scene, builder], rows[scene, "sweep"]
        made = 0.0 if row is sweep else float(row["build_seconds"]) + float(row["widen_seconds"])
        samples = HQ * PIXELS
        picture = samples * float(row["sample_seconds"])
        found.append(str((made + picture) / (samples * float(sweep["sample_seconds"]))))
    return found


def means(run: Run) -> str:
    """What docs/builders.md shows: means over the scenes, and the largest scene."""
    columns = {
        "SAH cost": "sah_ratio",
        "trace speed": "speed_ratio",
        "total time, 8 samples": "lq_ratio",
        "total time, 128 samples": "hq_ratio",
    }
    lines = []
    for builder in run.builders:
        figures = [run.of(builder, field, WIDTH) for field in columns.values()]
        figures.append(at_full_size(run, builder))
        cells = [f"{text(mean(own), '.2f')} ({text(own[-1], '.2f')})" for own in figures]
        lines.append([builder, *cells])
    return table(["builder", *columns, "128 samples, 1024 x 768"], lines)


def scenes(run: Run) -> str:
    """What was built over, and how many rays the pictures took."""
    lines = []
    for scene in run.scenes:
        row = next(r for r in run.rows if (r["scene"], r["builder"]) == (scene, "kmeans"))
        sweep = next(r for r in run.rows if (r["scene"], r["builder"]) == (scene, "sweep"))
        rays = f"{int(row['rays']) * 1e-6:.1f} M"
        speed = f"{float(sweep['mrays_per_second']):.2f}"
        lines.append([short(scene), f"{int(row['triangles']):,}", row["kmeans"], rays, speed])
    return table(["scene", "triangles", "k-means", "rays", "M rays/s of sweep"], lines)


def charts(run: Run, folder: Path) -> None:
    for scene in run.scenes:
        if short(scene) in CHARTS:
            own = [row for row in run.rows if row["scene"] == scene]
            file = folder / f"pictures-{short(scene)}.png"
            rows = [{key: parsed(value) for key, value in row.items()} for row in own]
            bvh_charts.draw_ratios(file, rows)
            shrink(file, file)


def main() -> None:
    folders = [Path(name) for name in sys.argv[1:]]
    if not folders:
        raise SystemExit(__doc__)
    run = Run(*sorted(folders, key=lambda folder: int(Run(folder).rows[0]["triangles"])))
    fill(ROOT / "docs" / "builders.md", {"means": means(run)}, SOURCE)
    tables = {name: run.by_scene(field, WIDTH, form) for name, (field, form) in FIELDS.items()}
    results = ROOT / "bench" / "results" / "builders-pictures-cpu.md"
    fill(results, {"scenes": scenes(run), **tables, "cheapest": run.cheapest()}, SOURCE)
    charts(run, ROOT / "docs" / "images")


if __name__ == "__main__":
    main()
