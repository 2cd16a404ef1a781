"""A city from nothing to pictures: tiles, one asset, a folder for a static host, a flight, a
render.

    python examples/city/city.py FOLDER --triangles 200e6 --memory 2GB --ray local

Each stage is skipped if it is done, so after Ctrl-C or a crash the same command goes on. What each
took is in FOLDER/figures.json, and as a table in FOLDER/figures.md.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tile import LOT, write_tile

import umbel

VIEWER = Path(__file__).resolve().parents[2] / "viewer"
LOT_TRIANGLES = 9_000  # in the mean of a large city, about
STAGES = ("tiles", "asset", "site", "flight", "picture")


class City:
    """The folder of a city, and how large it is."""

    def __init__(self, folder: Path, given: argparse.Namespace) -> None:
        self.folder, self.given = folder, given
        lots = math.sqrt(given.triangles / LOT_TRIANGLES)
        self.tiles_a_row = max(1, math.ceil(lots / given.tile_lots))
        self.lots = max(1, round(lots / self.tiles_a_row))
        self.side = self.tiles_a_row * self.lots * LOT
        self.asset, self.site = folder / "city.umbel", folder / "site"

    def tiles(self) -> dict[str, Any]:
        """Writes the tiles, those that are not there yet."""
        folder = self.folder / "tiles"
        folder.mkdir(exist_ok=True)
        triangles = size = 0
        for k in range(self.tiles_a_row**2):
            row, column = divmod(k, self.tiles_a_row)
            path = folder / f"tile_{row:02d}_{column:02d}.glb"
            if not path.exists():
                write_tile(path, row, column, self.lots, self.side / 2)
            triangles += triangles_of(path)
            size += path.stat().st_size
            show(f"tile {k + 1} of {self.tiles_a_row**2}, {triangles:,} triangles")
        return {"triangles": triangles, "bytes": size, "files": self.tiles_a_row**2}

    def make_asset(self) -> dict[str, Any]:
        """Builds one asset of all tiles, unit by unit, where Ray has machines for them."""
        work = self.folder / "work"
        executor = umbel.scale.Ray(self.given.ray) if self.given.ray else None
        report = umbel.build_asset(
            [str(self.folder / "tiles" / "*.glb")],
            self.asset,
            memory=self.given.memory,
            work=work,
            resume=work.exists(),
            unit_triangles=self.given.unit_triangles,
            executor=executor,
            progress=lambda share, stage: show(f"{100 * share:5.1f} % {stage}"),
        )
        names = ("levels", "groups", "clusters", "triangles_all_levels")
        return {"bytes": self.asset.stat().st_size, **{k: report[k] for k in names}}

    def make_site(self) -> dict[str, Any]:
        """A folder for any static host: the viewer's page, and the asset, read by ranges."""
        shutil.rmtree(self.site, ignore_errors=True)
        umbel.export_viewer(self.asset, self.site)
        files = [path for path in self.site.rglob("*") if path.is_file()]
        return {"bytes": sum(path.stat().st_size for path in files), "files": len(files)}

    def flight(self) -> dict[str, Any]:
        """Flies through the city in headless Chromium, with 512 MB for geometry and textures."""
        path = self.folder / "flight.json"
        path.write_text(json.dumps({"kind": "umbel-camera-path", "keys": self.keys()}))
        command = ["node", VIEWER / "scripts" / "fly.mjs", self.site, path, self.folder / "flight"]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        return dict(json.loads(done.stdout))

    def picture(self) -> dict[str, Any]:
        """A picture. The near streets of a large city need more than 512 MB."""
        eye, target = self.view(0.0)
        out = self.folder / "city.png"
        command = [sys.executable, "-m", "umbel", "render", self.asset, "-o", out, "--json"]
        command += ["--camera", f"{','.join(map(str, eye))}:{','.join(map(str, target))}:50"]
        command += ["--width", "1280", "--height", "800", "--budget", "3GB"]
        command += ["--spp", str(self.given.samples)]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        said = json.loads(done.stdout.splitlines()[-1])
        return {"file": out.name, "triangles": said["triangles"]}

    def view(self, turn: float) -> tuple[list[float], list[float]]:
        """A camera over the city's edge, `turn` times around it."""
        middle, angle = self.side / 2, 2 * math.pi * (turn + 0.1)
        away = 0.42 * self.side
        eye = [
            middle + away * math.cos(angle),
            0.06 * self.side + 60,
            middle + away * math.sin(angle),
        ]
        return [round(x, 2) for x in eye], [middle, 30.0, middle]

    def keys(self) -> list[dict[str, Any]]:
        """Around the city, down, and through a street from one end to the other."""
        keys = []
        for k in range(20):
            eye, target = self.view(k / 40)
            keys.append({"position": eye, "target": target})
        street = (self.side // LOT // 2) * LOT
        for k in range(41):
            x = self.side * (0.02 + 0.9 * k / 40)
            keys.append({"position": [x, 25.0, street], "target": [x + 60, 22.0, street]})
        return [{**key, "time": 500 * k} for k, key in enumerate(keys)]


def triangles_of(path: Path) -> int:
    """Of a .glb that `write_tile` wrote."""
    with path.open("rb") as file:
        head = file.read(20)
        root = json.loads(file.read(int.from_bytes(head[12:16], "little")))
    indices = [p["indices"] for mesh in root["meshes"] for p in mesh["primitives"]]
    return sum(root["accessors"][k]["count"] for k in indices) // 3


def show(text: str) -> None:
    """One line that is written over."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


def run(name: str, stage: Callable[[], dict[str, Any]], folder: Path) -> None:
    """Runs a stage that is not done, and keeps its figures."""
    file = folder / "figures.json"
    figures = json.loads(file.read_text()) if file.exists() else {}
    if name in figures:
        print(f"{name}: done before")
        return
    began = time.perf_counter()
    found = stage()
    show("")
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    memory = max(children, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * 1024
    figures[name] = {"seconds": time.perf_counter() - began, **found, "largest_process": memory}
    part = file.with_suffix(".part")
    part.write_text(json.dumps(figures, indent=1) + "\n")
    os.replace(part, file)
    print(f"{name}: {json.dumps(figures[name])}")


def write_table(folder: Path) -> None:
    """FOLDER/figures.md."""
    figures = json.loads((folder / "figures.json").read_text())
    lines = ["| stage | s | GB | |", "| --- | --: | --: | --- |"]
    for name, found in figures.items():
        rest = {k: v for k, v in found.items() if k not in ("seconds", "bytes")}
        told = ", ".join(
            f"{k.replace('_', ' ')} {f'{v:,}' if isinstance(v, int) else v}"
            for k, v in rest.items()
        )
        size = f"{found['bytes'] / 1e9:.2f}" if "bytes" in found else ""
        lines.append(f"| {name} | {found['seconds']:.0f} | {size} | {told} |")
    (folder / "figures.md").write_text("\n".join(lines) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--triangles", type=float, default=8e6, help="of all tiles, about")
    parser.add_argument("--memory", default="2GB", help="for the build")
    parser.add_argument("--ray", help="a cluster's address; local starts one on this machine")
    parser.add_argument("--unit-triangles", type=int, default=0, help="most in a unit, 4 Mi")
    parser.add_argument("--tile-lots", type=int, default=16, help="most lots along a tile")
    parser.add_argument("--samples", type=int, default=32, help="paths a pixel of the picture")
    parser.add_argument("--until", choices=STAGES, default=STAGES[-1], help="the last stage")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    city = City(given.folder, given)
    stages = (city.tiles, city.make_asset, city.make_site, city.flight, city.picture)
    for name, stage in zip(STAGES, stages, strict=True):
        run(name, stage, given.folder)
        write_table(given.folder)
        if name == given.until:
            break


if __name__ == "__main__":
    main()
