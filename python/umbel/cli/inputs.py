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
    from umbel.errors import Error
    from umbel.scale.memory import as_bytes

    try:
        return as_bytes(text)
    except Error:
        fail(f"{option} must be a size such as 64MB, not {text!r}")


def load_mesh(source: str, *, allow_outside: bool, drops: bool = False, threads: int = 0) -> Mesh:
    """The mesh in a file, as it is drawn. What no command can work on is refused, with the place in
    the file, unless the command `drops` it."""
    from umbel.geometry.repair import validate
    from umbel.io import load

    mesh = load(source, allow_outside=allow_outside)
    if not drops:
        validate(mesh, threads=threads)
    return mesh


def empty_mesh() -> Mesh:
    """For checks of settings before a file is read: what is built of it refuses wrong ones."""
    import numpy as np

    from umbel.geometry.mesh import Mesh

    return Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
