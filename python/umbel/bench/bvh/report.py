"""A comparison of builders as Markdown, CSV and charts."""

from __future__ import annotations

from pathlib import Path

from umbel.bench import charts
from umbel.bench.bvh import charts as bvh_charts
from umbel.bench.bvh import kmeans as bvh_kmeans
from umbel.bench.bvh.columns import CHEAPEST, COLUMNS, MEANS
from umbel.bench.bvh.compare import Comparison
from umbel.bench.bvh.methods import LARGE, Effort
from umbel.bench.bvh.scenes import COSTS
from umbel.bench.bvh.totals import HQ, LQ
from umbel.bench.bvh.tracing import passes
from umbel.bench.table import csv_text, markdown, write_tables
from umbel.bench.timing import cores


def _totals(effort: Effort) -> str:
    """What was traced, and what of the total times follows from it."""
    paths = "1 path" if effort.samples == 1 else f"{effort.samples} paths"
    once = ", each ray once" if len(passes(effort.samples)) > 1 else ""
    what = (
        f"a build, widening and one picture with {LQ} (LQ) and {HQ} (HQ) samples a pixel, the mean "
        "of the views"
    )
    if effort.share < 1:
        return (
            f"{paths} a pixel in {effort.share:.3g} of the pictures' tiles were traced{once}; the "
            f"total times, of {what}, are extrapolated from that."
        )
    how = {
        LQ: f"LQ is measured, and HQ is {HQ // LQ} times its tracing",
        HQ: f"HQ is measured, and the tracing of LQ is the mean of {HQ // LQ} pictures",
    }.get(effort.samples, "both in proportion to what was traced")
    return (
        f"{paths} a pixel of whole pictures were traced{once}. The total times are those of "
        f"{what}: {how}."
    )


def _legend(effort: Effort) -> str:
    how = (
        "One thread, timed by the processor time that it used."
        if effort.threads == 1
        else f"{effort.threads or cores()} threads, timed by the wall clock."
    )
    parts = [
        f"{how} Medians of {effort.runs} runs that took turns; scenes of over {LARGE:,} triangles "
        f"are built once, and their EPO is left out. At most 8 triangles a leaf, costs "
        f"{COSTS[0]:g} and {COSTS[1]:g}."
    ]
    if "builders" in effort.parts:
        parts += [
            f"Three views of {effort.resolution[0]} x {effort.resolution[1]}, two shadow rays at "
            f"each hit. {_totals(effort)} Width: children a node of what is traced.",
            "Ratios are to the full sweep of the same width with zero build time: for speed more "
            "is better, for the others less.",
        ]
    return "\n\n".join(parts)


def report(found: Comparison) -> str:
    """The comparison as a Markdown document."""
    machine = "\n".join(found.machine.sentences())
    parts = ["# Builders of hierarchies", machine, _legend(found.effort)]
    for name, kmeans in found.settings.items():
        rows = [row for row in found.rows if row["scene"] == name]
        if rows:
            parts += [
                f"## {name}",
                f"{rows[0]['triangles']:,} triangles; k-means with {kmeans}.",
                markdown(COLUMNS[1:], rows).rstrip(),
            ]
    if found.rows:
        parts += [
            "## Geometric means over the scenes",
            markdown(MEANS, found.means).rstrip(),
            "## Which builder for how many samples",
            "The builder that makes one picture soonest from so many samples, or rays, on.",
            markdown(CHEAPEST, found.cheapest).rstrip(),
        ]
    for title, columns, rows in (
        ("k-means by stage", bvh_kmeans.STAGES, found.stages),
        ("SAH cost of k-means after iterations", bvh_kmeans.ITERATIONS, found.iterations),
    ):
        if rows:
            parts += [f"## {title}", markdown(columns, rows).rstrip()]
    return "\n\n".join(parts) + "\n"


def write(found: Comparison, folder: Path) -> list[Path]:
    """Writes the tables, and charts if matplotlib is there; the files written."""
    tables = {
        "bvh.csv": found.rows,
        "bvh_cheapest.csv": found.cheapest,
        "bvh_stages.csv": found.stages,
        "bvh_iterations.csv": found.iterations,
    }
    texts = {"bvh.md": report(found)}
    texts |= {name: csv_text(rows) for name, rows in tables.items() if rows}
    written = write_tables(folder, texts)
    if not charts.available():
        return written
    drawn = bvh_charts.draw(folder, found.rows, found.stages, found.iterations)
    return written + drawn + bvh_charts.save_previews(folder, found.previews)
