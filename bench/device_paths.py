"""Pictures by path tracing through the trees of a device's builders: a run of a scene, and the page
of all runs. Needs NumPy; of umbel what is not compiled.

    python bench/device_paths.py missing SCENES FOLDER      scenes without a whole run
    python bench/device_paths.py unpack SCENES NAME OUT.ply
    python bench/device_paths.py run SCENES NAME FOLDER/NAME.json PROGRAM [ARGUMENT...]
    python bench/device_paths.py report FOLDER PAGE.md      charts beside the page

SCENES is a folder that bench/device_scenes.py has packed, PROGRAM cuda_paths_bench, or
device_paths_bench where there is no device.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from builders_docs import mean, short
from device_scenes import scenes, unpack
from docs_tables import table

from umbel.bench import charts
from umbel.bench.bvh import charts as bvh_charts
from umbel.bench.bvh.columns import BASELINE
from umbel.bench.bvh.totals import HQ, LQ, cheapest, normalised
from umbel.replacing import replacing

Row = dict[str, Any]
SLIDES = ("sponza", "conference", "plant")
"""Scenes that get a chart."""
NODE_BYTES = 80


def run(folder: Path, name: str, out: Path, command: Sequence[str]) -> None:
    """Traces a scene; the file is written once all is done."""
    scene = scenes(folder)[name]
    words = ["--name", name, "--kmeans", ",".join(map(str, scene["kmeans"]))]
    for camera in scene["cameras"]:
        words += ["--camera", ",".join(map(repr, camera))]
    with tempfile.TemporaryDirectory() as place:
        mesh = Path(place) / f"{name}.ply"
        unpack(folder, name, mesh)
        print(f"{name}: {mesh.stat().st_size / 2**20:.0f} MiB", file=sys.stderr, flush=True)
        done = subprocess.run([*command, *words, mesh], stdout=subprocess.PIPE, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{name}: {command[0]} ended with status {done.returncode}")
    json.loads(done.stdout)
    with replacing(out) as file:
        file.write(done.stdout)


def missing(folder: Path, results: Path) -> list[str]:
    """The scenes of which not all samples have been traced."""
    found = []
    for name in scenes(folder):
        result = results / f"{name}.json"
        done = json.loads(result.read_text()) if result.is_file() else None
        if done is None or done["samples"] < done["samples_wanted"]:
            found.append(name)
    return found


def rows_of(found: Mapping[str, Any]) -> list[Row]:
    """What was measured of a scene, as `umbel bench bvh` has it: a row a builder."""
    pixels = found["resolution"][0] * found["resolution"][1]
    paths = found["paths"] / len(found["builders"][0]["views"])
    kmeans = _kmeans(found)
    rows = []
    for builder in found["builders"]:
        views = builder["views"]
        build = sum(builder["stages"].values()) * 1e-3
        seconds = [(view["nearest_ms"] + view["shadows_ms"]) * 1e-3 for view in views]
        rays = [view["nearest"] + view["shadows"] for view in views]
        rows.append(
            {
                "scene": found["scene"],
                "triangles": found["triangles"],
                "width": 8,
                "builder": builder["builder"],
                "kmeans": kmeans if builder["builder"].startswith("kmeans") else None,
                "build_seconds": build,
                "widen_seconds": 0.0,  # builds are ready to trace
                "mtriangles_per_second": found["triangles"] / build * 1e-6,
                "sah_cost": builder["sah"],
                "epo": None,
                "rays": sum(rays),
                "mrays_per_second": sum(rays) / sum(seconds) * 1e-6,
                "sample_seconds": sum(seconds) / len(views) / paths * pixels,
                "sample_rays": sum(rays) / len(views) / paths * pixels,
                "tree_bytes": NODE_BYTES * builder["nodes"] / found["triangles"],
                "scratch_bytes": builder["scratch_bytes"],
            }
        )
    return rows


def _kmeans(found: Mapping[str, Any]) -> str:
    k, p, i = found["kmeans"]
    return f"k {k}, p {p}, i {i}"


def by_scene(rows: Sequence[Row], cell: Callable[[Row], float | None], form: str) -> str:
    """Builders by scenes, and geometric means."""
    names = list(dict.fromkeys(row["scene"] for row in rows))
    lines = []
    for builder in dict.fromkeys(row["builder"] for row in rows):
        cells = {row["scene"]: cell(row) for row in rows if row["builder"] == builder}
        values = [cells.get(name) for name in names]
        known = [repr(value) for value in values if value]
        texts = ["" if value is None else format(value, form) for value in [*values, mean(known)]]
        lines.append([builder, *texts])
    return table(["builder", *map(short, names), "mean"], lines)


def scene_table(runs: Sequence[Mapping[str, Any]], rows: Sequence[Row]) -> str:
    """What was traced."""
    lines = []
    for found in runs:
        sweep = next(r for r in rows if (r["scene"], r["builder"]) == (found["scene"], BASELINE))
        lines.append(
            [
                short(found["scene"]),
                f"{found['triangles']:,}",
                _kmeans(found),
                str(found["samples"]),
                f"{sweep['rays'] * 1e-6:,.1f} M",
                f"{sweep['mrays_per_second']:,.1f}",
                f"{found['seconds']:,.0f}",
            ]
        )
    head = ["scene", "triangles", "k-means", "samples", "rays", "M rays/s of sweep", "run, s"]
    return table(head, lines)


def fastest(rows: Sequence[Row]) -> str:
    """From how many rays on which builder makes a picture soonest."""
    lines = []
    found = cheapest(rows)
    for scene in dict.fromkeys(row["scene"] for row in found):
        texts = [
            f"from {row['from_mrays']:.2g} {row['builder']}"
            if row["from_mrays"]
            else row["builder"]
            for row in found
            if row["scene"] == scene
        ]
        lines.append([short(scene), ", ".join(texts)])
    return table(["scene", "builders"], lines)


def page(runs: Sequence[Mapping[str, Any]]) -> str:
    """All of it as Markdown."""
    rows = [row for found in runs for row in normalised(rows_of(found))]
    width, height = runs[0]["resolution"]
    views = len(runs[0]["builders"][0]["views"])
    parts = [
        f"# Pictures by path tracing on {runs[0]['device']}",
        f"After the evaluation of Meister and Bittner (2016): {views} views of {width} x {height} "
        "of each scene, paths with Russian roulette from the third bounce on, two shadow rays at "
        "each hit. Rays are made on the device, some samples per pixel at a time, and each goes "
        "once through every tree, the trees by turns; making them is not in the times. All trees "
        f"had the same hits, to the bit. Builds are medians of {runs[0]['runs']} (the sweep's of "
        "large scenes one run), ready to trace, with 8 children per node, at most 8 triangles per "
        "leaf, costs 3 and 2. `kmeans 2016` is as published, `kmeans` has the library's defaults.",
    ]
    short_of = [found for found in runs if found["samples"] < found["samples_wanted"]]
    if short_of:
        names = ", ".join(short(found["scene"]) for found in short_of)
        parts.append(
            f"Of {names} time ran out before all samples were traced (see below); totals are in "
            "proportion to those that were."
        )
    tables: dict[str, str] = {
        "Scenes": scene_table(runs, rows),
        "Trace speed relative to the full sweep": by_scene(rows, _field("speed_ratio"), ".3f"),
        f"Total time with {LQ} samples per pixel, relative to the full sweep in no build time": (
            by_scene(rows, _field("lq_ratio"), ".3f")
        ),
        f"Total time with {HQ} samples per pixel, relative to the same": (
            by_scene(rows, _field("hq_ratio"), ".3f")
        ),
        "SAH cost relative to the full sweep": by_scene(rows, _field("sah_ratio"), ".3f"),
        "Builds, milliseconds": by_scene(rows, _field("build_seconds", 1e3), ".3f"),
        "Builds, million triangles per second": (
            by_scene(rows, _field("mtriangles_per_second"), ".1f")
        ),
        "Million rays per second": by_scene(rows, _field("mrays_per_second"), ".1f"),
        f"A picture with {LQ} samples per pixel, milliseconds": (
            by_scene(rows, _field("lq_seconds", 1e3), ".2f")
        ),
        f"A picture with {HQ} samples per pixel, milliseconds": (
            by_scene(rows, _field("hq_seconds", 1e3), ".1f")
        ),
        "The fastest builder, from so many million rays on, build included": fastest(rows),
    }
    parts += [f"## {title}\n\n{text}" for title, text in tables.items()]
    return "\n\n".join(parts) + "\n"


def _field(name: str, factor: float = 1.0) -> Callable[[Row], float | None]:
    return lambda row: None if row[name] is None else row[name] * factor


def report(folder: Path, out: Path) -> None:
    """Writes the page of all runs in a folder, and charts if matplotlib is there."""
    runs = [json.loads(path.read_text()) for path in folder.glob("*.json")]
    if not runs:
        raise SystemExit(f"there are no runs in {folder}")
    runs.sort(key=lambda found: (found["triangles"], found["scene"]))
    with replacing(out) as file:
        file.write(page(runs).encode())
    if not charts.available():
        return
    for found in runs:
        if short(found["scene"]) in SLIDES:
            rows = normalised(rows_of(found))
            bvh_charts.draw_ratios(out.with_name(f"{out.stem}-{short(found['scene'])}.png"), rows)


def main() -> None:
    """See the top."""
    command, *words = sys.argv[1:] or ["help"]
    if command == "missing" and len(words) == 2:
        print("".join(f"{name}\n" for name in missing(Path(words[0]), Path(words[1]))), end="")
    elif command == "unpack" and len(words) == 3:
        unpack(Path(words[0]), words[1], Path(words[2]))
    elif command == "run" and len(words) >= 4:
        run(Path(words[0]), words[1], Path(words[2]), words[3:])
    elif command == "report" and len(words) == 2:
        report(Path(words[0]), Path(words[1]))
    else:
        raise SystemExit(__doc__)


if __name__ == "__main__":
    main()
