"""Reading the meshes that commands are given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from umbel.cli.run import fail

if TYPE_CHECKING:
    from umbel.geometry.mesh import Mesh

MeshFile = Annotated[str, typer.Argument(metavar="INPUT", help="Mesh: .glb .gltf .obj .ply .stl.")]
AllowOutside = Annotated[
    bool,
    typer.Option(
        "--allow-outside",
        help="Read files that INPUT refers to (buffers, material libraries, images) from outside "
        "its folder, too.",
    ),
]


def bytes_of(option: str, text: str) -> int:
    """Bytes of a size such as 64MB; powers of 1000, and of 1024 for MiB."""
    units = {"": 1, "B": 1, "KB": 1e3, "MB": 1e6, "GB": 1e9}
    units |= {"KIB": 2**10, "MIB": 2**20, "GIB": 2**30}
    number = text.strip().rstrip("BbIiKkMmGg")
    try:
        size = float(number) * units[text.strip()[len(number) :].upper()]
    except (KeyError, ValueError):
        size = 0.0
    if not 1 <= size < 1e18:
        fail(f"{option} must be a size such as 64MB, not {text!r}")
    return int(size)


def load_mesh(source: str, *, allow_outside: bool, drops: bool = False, threads: int = 0) -> Mesh:
    """The mesh in a file, as it is drawn. What no command can work on is refused, with the place in
    the file, unless the command `drops` it."""
    from umbel.geometry.repair import validate
    from umbel.io import load

    mesh = load(source, allow_outside=allow_outside)
    if not drops:
        validate(mesh, threads=threads)
    return mesh
