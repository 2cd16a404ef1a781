"""Measures rays, builds and refits, and puts the figures into bench/results/rays-cpu-amd.md,
rays-cpu-amd-avx2.md (a processor without AVX-512) or rays-cpu-intel.md, as the processor is. Takes
some minutes, on a machine that does nothing else.
With tinybvh too where CMake was told UMBEL_BENCH_TINYBVH=ON.

    python bench/rays_docs.py --embree LIBRARY [--runs N] [--size PIXELS] MESH...
"""

from __future__ import annotations

import argparse
import datetime
import os
import subprocess
import sys
from pathlib import Path

from docs_tables import ROOT, fill

PROGRAMS = ROOT / "build" / "release" / "bench"


def processor() -> str:
    """As Linux names it."""
    fields = (line.split(":") for line in Path("/proc/cpuinfo").read_text().splitlines())
    known = {field[0].strip(): field[1].strip() for field in fields if len(field) > 1}
    return (
        f"{known.get('model name', 'unknown')} (family {known.get('cpu family')}, "
        f"model {known.get('model')})"
    )


def page_of_processor() -> Path:
    vendor = "intel" if "Intel" in processor() else "amd"
    has_avx512 = " avx512vl " in Path("/proc/cpuinfo").read_text()
    page = ROOT / "bench" / "results" / f"rays-cpu-{vendor}{'' if has_avx512 else '-avx2'}.md"
    if not page.is_file():
        sys.exit(f"there is no {page} to fill: copy another page for this kind of processor")
    return page


def output(*command: str | Path) -> str:
    print("$", *command, file=sys.stderr, flush=True)
    return subprocess.run(
        [str(word) for word in command], check=True, stdout=subprocess.PIPE, text=True
    ).stdout.strip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--embree", type=Path, required=True, help="libembree4 of any version")
    parser.add_argument("--runs", default="5")
    parser.add_argument("--size", default="384")
    args = parser.parse_args()
    page = page_of_processor()
    runs = ("--runs", args.runs)
    views = ("--size", args.size)
    compare = PROGRAMS / "ray_bench"
    rays = output(
        compare, "--embree", args.embree, *runs, *views, "--only", "umbel best", *args.meshes
    )
    each, ratios = rays[: rays.index("\numbel over")], rays[rays.index("\numbel over") :]
    batches = output(sys.executable, ROOT / "bench" / "ray_batches.py", *runs, *views, *args.meshes)
    builders = ("--builder", "binned", "--builder", "lbvh")
    trees = output(PROGRAMS / "bvh_build_bench", *runs, *builders, *args.meshes)
    for mesh in args.meshes:
        trees = trees.replace(str(mesh), mesh.name)
    day = datetime.date.today()
    texts = {
        "machine": f"{day.day} {day:%B %Y}, {os.cpu_count()} cores of an {processor()}; "
        f"medians of {args.runs} runs, {args.size} x {args.size} pixels a view.",
        "ratios": ratios.strip(),
        "batches": batches,
        "threads": output(PROGRAMS / "triangle_bvh_bench", *runs, *args.meshes),
        "trees": f"```\n{trees}\n```",
        "meshes": each.strip(),
    }
    fill(page, texts)


if __name__ == "__main__":
    main()
