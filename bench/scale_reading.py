"""What it takes to open and use a large asset: resident memory and time of each command.

    .venv/bin/python bench/scale_reading.py ASSET [--skip verify export]

Each line is a process of its own. Memory is the most that was resident in it, that of Python and
its modules with it, which the first line shows; time is of processors.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

OPEN = """
import sys, time, resource, umbel
memory = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
umbel.Asset, umbel.Camera  # which imports them
before, began = memory(), time.perf_counter()
asset = umbel.Asset(sys.argv[1])
asset.info, asset.meshes, asset.page_sizes
seconds = time.perf_counter() - began
print(f"{1000 * seconds:.1f} ms, {(memory() - before) / 1000:.1f} MB more")
"""

CUTS = """
import math, sys, umbel
asset = umbel.Asset(sys.argv[1])
count, worst = sum(mesh["source_triangles"] for mesh in asset.meshes), 0
for share in range(1, 13):
    for one in asset.scene_cuts(triangles=max(1, count >> share), or_coarsest=True):
        worst = max(worst, one.found.pages / max(1, one.found.cut_pages))
low, high = asset.meshes[0]["bounds"]
middle = [(a + b) / 2 for a, b in zip(low, high)]
for away in (0.05, 0.2, 1.0, 4.0):
    eye = tuple(m + away * (b - a) for m, a, b in zip(middle, low, high))
    camera = umbel.Camera(eye, tuple(middle), fov_y=0.8, height=1080)
    for one in asset.scene_cuts(camera=camera):
        worst = max(worst, one.found.pages / max(1, one.found.cut_pages))
print(f"at most {worst:.2f} pages read for each page of a cut")
"""

STREAM = """
import sys, time, umbel
asset = umbel.Asset(sys.argv[1])
low, high = asset.meshes[0]["bounds"]
middle = [(a + b) / 2 for a, b in zip(low, high)]
residency = umbel.Residency(asset, 64 << 20)
for step in range(400):
    away = 0.05 + 0.5 * step / 400
    eye = tuple(m + away * (b - a) for m, a, b in zip(middle, low, high))
    residency.step([umbel.Camera(eye, tuple(middle), fov_y=0.8, height=1080)], step / 60)
    time.sleep(0.005)
said = residency.statistics
print(f"{said['loads']} pages loaded, {said['resident_bytes'] / 1e6:.0f} MB of them resident")
residency.close()
"""

VIEW = """
import sys, urllib.request, umbel
from umbel.viewer.server import Server
from pathlib import Path
server = Server(Path(sys.argv[1]))
name = server.url.partition("asset=")[2]
address = server.url.partition("?")[0] + name
for first in range(0, Path(sys.argv[1]).stat().st_size, 40 << 10):
    asked = urllib.request.Request(address, headers={"Range": f"bytes={first}-{first + 40959}"})
    urllib.request.urlopen(asked).read()
server.close()
print("all of the file by ranges")
"""


def lines_of(asset: Path, folder: Path) -> list[tuple[str, str, list[str]]]:
    """Kind, what the table says of it, and the command."""
    python, umbel = [sys.executable, "-c"], [sys.executable, "-m", "umbel"]
    path = str(asset)
    picture = str(folder / "picture.png")

    def extract(count: int) -> tuple[str, str, list[str]]:
        name = f"`umbel extract --triangles {count}`"
        out = str(folder / f"{count}.ply")
        return "extract", name, [*umbel, "extract", path, "-o", out, "--triangles", str(count)]

    def render(name: str, *options: str) -> tuple[str, str, list[str]]:
        size = ["--width", "1024", "--height", "768", "--spp", "1"]
        return "render", f"`umbel render{name}`", [
            *umbel, "render", path, "-o", picture, *size, *options,
        ]  # fmt: skip

    return [
        ("python", "Python and `import umbel`", [*python, "import umbel"]),
        ("open", "`umbel.Asset(path)`", [*python, OPEN, path]),
        ("info", "`umbel info`", [*umbel, "info", path]),
        ("cuts", "16 cuts, by triangles and by camera", [*python, CUTS, path]),
        extract(100_000),
        extract(1_000_000),
        ("stream", "`umbel.Residency`, 64 MiB, 400 steps", [*python, STREAM, path]),
        render(""),
        render(" --budget 64MB", "--budget", "64MB"),
        ("view", "the viewer's server", [*python, VIEW, path]),
        ("export", "`umbel export`, 3D Tiles", [*umbel, "export", path, "-o", str(folder / "t")]),
        ("verify", "`umbel verify --memory 1GB`", [*umbel, "verify", path, "--memory", "1GB"]),
        ("verify", "`umbel verify --memory 250MB`", [*umbel, "verify", path, "--memory", "250MB"]),
    ]


def main() -> int:
    """Runs all, and prints a line each; the exit status is 1 if any fails."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("asset", type=Path)
    parser.add_argument("--skip", nargs="*", default=[])
    args = parser.parse_args()
    failed = 0
    print("| what | resident | processor s | says |")
    print("| --- | --: | --: | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for kind, name, command in lines_of(args.asset, Path(folder)):
            if kind in args.skip:
                continue
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            assert process.stdout is not None
            said = process.stdout.read().decode().strip()
            _, status, usage = os.wait4(process.pid, 0)
            failed += status != 0
            shown = said if kind in ("open", "cuts", "stream", "view") else ""
            cells = [
                name,
                f"{usage.ru_maxrss / 1000:.0f} MB",
                f"{usage.ru_utime + usage.ru_stime:.1f}",
                shown if status == 0 else f"FAILED: {status}",
            ]
            print(f"| {' | '.join(cells)} |", flush=True)
            time.sleep(0.1)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
