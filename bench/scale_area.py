"""How much area small components keep in far levels, in units beside in memory.

    .venv/bin/python bench/scale_area.py [--units 4096 16384] [MESH or KIND:TRIANGLES]...

A kind is one of `umbel.testing.giant`, such as foliage:1000000. For each share of the triangles:
the part of the mesh's area that a cut of so many triangles has, of a build in memory, of builds in
units of so many triangles, and of both without `keep_area`.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

import umbel
from umbel.scale.build_asset import build_asset
from umbel.testing import giant

SHARES = (4, 16, 64, 256)


def area(mesh: umbel.Mesh) -> float:
    """Of all triangles."""
    a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def source_of(name: str, folder: Path) -> umbel.Mesh:
    """The mesh of a file, or one that is made."""
    kind, _, triangles = name.partition(":")
    if not triangles:
        mesh = umbel.load(name)
        return umbel.Mesh(mesh.positions, mesh.triangles, origin=mesh.origin)
    giant.write(giant.make(kind, int(float(triangles))), folder / "made.ply")
    return umbel.load(folder / "made.ply")


def shares(path: Path, mesh: umbel.Mesh) -> list[str]:
    """The part of the area that cuts keep."""
    asset, whole, said = umbel.Asset(path), area(mesh), []
    for share in SHARES:
        cut = asset.cut(triangles=max(1, len(mesh.triangles) // share), or_coarsest=True)
        said.append(f"{area(asset.mesh(cut)) / whole:.3f}")
    return said


def main() -> None:
    """Builds, and prints a line a build."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("meshes", nargs="*", default=["foliage:1000000"])
    parser.add_argument("--units", nargs="*", type=int, default=[4096, 16384, 65536])
    args = parser.parse_args()
    print("| mesh | build | keep_area | " + " | ".join(f"1/{share}" for share in SHARES) + " |")
    print("| --- | --- | --- |" + " --: |" * len(SHARES))
    for name in args.meshes:
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            mesh = source_of(name, folder)
            for keep_area in (True, False):
                for units in (0, *args.units):
                    path = folder / "built.umbel"
                    if units:
                        build_asset(mesh, path, unit_triangles=units, keep_area=keep_area)
                    else:
                        umbel.build_lod(mesh, keep_area=keep_area).save(path)
                    how = f"units of {units:,}" if units else "in memory"
                    cells = [Path(name).stem, how, "yes" if keep_area else "no"]
                    print("| " + " | ".join([*cells, *shares(path, mesh)]) + " |", flush=True)


if __name__ == "__main__":
    main()
