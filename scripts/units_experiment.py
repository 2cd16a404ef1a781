"""Builds meshes in units by processes of their own, and checks what comes out.

    .venv/bin/python scripts/units_experiment.py FOLDER [--capacity 4096] [--rounds N] [--only PART]

For each mesh file of the folder: one worker, one worker with the units in reverse order, two and
four workers must give the same bytes, and every result must pass `verify`. Runs build/release's
bench/units_check, and prints a line a mesh.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

import umbel

MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl")
RUNS = (("1", "forward"), ("1", "reversed"), ("2", "forward"), ("4", "reversed"))


def write_raw(mesh: umbel.Mesh, path: Path) -> None:
    """The streams that units_check reads: the count of each, then its values."""
    streams = (
        (mesh.positions, np.float32),
        (mesh.triangles, np.uint32),
        (mesh.normals, np.float32),
        (mesh.tangents, np.float32),
        (mesh.uvs, np.float32),
        (mesh.colors, np.float32),
        (mesh.material_ids, np.uint32),
    )
    with path.open("wb") as file:
        for values, kind in streams:
            array = np.zeros(0, kind) if values is None else np.ascontiguousarray(values, kind)
            file.write(np.uint64(len(array)).tobytes() + array.tobytes())


def lines_of(program: Path, mesh: Path, capacity: int, rounds: int) -> list[str]:
    """What each way to run gives."""
    lines = []
    for workers, order in RUNS:
        with tempfile.TemporaryDirectory() as work:
            command = [str(program), str(mesh), work, str(capacity), workers, order, str(rounds)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            lines.append((done.stdout + done.stderr).strip())
    return lines


def main() -> int:
    """Runs all meshes; the exit status is 1 if any fails."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--capacity", type=int, default=4096)
    parser.add_argument("--rounds", type=int, default=0, help="levels a tier; 0: by the capacity")
    parser.add_argument("--only", default="")
    parser.add_argument("--least", type=int, default=0, help="leave out meshes of fewer triangles")
    parser.add_argument("--most", type=int, default=1 << 32, help="and of more")
    root = Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=Path, default=root / "build/release/bench/units_check")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    failed = 0
    for path in sorted(args.folder.iterdir()):
        if path.suffix not in MESHES or args.only not in path.name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            raw = Path(folder) / "mesh.raw"
            try:
                mesh = umbel.load(path)
            except umbel.Error as error:
                print(f"{path.name}: not read: {error}", flush=True)
                continue
            if not len(mesh.triangles):
                print(f"{path.name}: no triangles", flush=True)
                continue
            if not args.least <= len(mesh.triangles) <= args.most:
                continue
            write_raw(mesh, raw)
            lines = lines_of(args.program, raw, args.capacity, args.rounds)
        good = len(set(lines)) == 1 and "verify ok" in lines[0]
        failed += not good
        shown = lines[:1] if good else lines
        print(f"{path.name}: {'equal' if good else 'FAILED'}: " + "\n    ".join(shown), flush=True)
    print(f"{failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
