"""Writes a mesh from a shell: python -m umbel.testing.giant scan 16000000 scan.ply"""

from __future__ import annotations

import argparse

from umbel.testing import giant


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m umbel.testing.giant", description=giant.__doc__
    )
    parser.add_argument("kind", choices=giant.KINDS)
    parser.add_argument("triangles", type=int)
    parser.add_argument("path", help=".ply, .stl, .obj or .glb; with --tiles a folder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seams", action="store_true", help="charts of texture coordinates")
    parser.add_argument("--shuffled", action="store_true", help="everything in random order")
    parser.add_argument("--soup", action="store_true", help="three vertices a triangle")
    parser.add_argument("--tiles", metavar="EXTENSION", help="many files of this extension")
    given = parser.parse_args()
    mesh = giant.make(
        given.kind,
        given.triangles,
        given.seed,
        seams=given.seams,
        shuffled=given.shuffled,
        soup=given.soup,
    )
    if given.tiles:
        giant.write_tiles(mesh, given.path, given.tiles)
    else:
        giant.write(mesh, given.path)


if __name__ == "__main__":
    main()
