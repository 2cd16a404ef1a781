"""What a PLY file holds and a mesh cannot is named in one warning, however the file is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from helpers.mesh_files import ply_bytes
from umbel.errors import LoadWarning
from umbel.io import load
from umbel.io.blocks import open_source

XYZ = [("float", "x"), ("float", "y"), ("float", "z")]
FACE = [("list", "uchar", "int", "vertex_indices")]
POINTS = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
BYTES = "binary_little_endian"


def lost(tmp_path: Path, data: bytes, in_parts: bool = False) -> str:
    """What the warning says."""
    path = tmp_path / "mesh.ply"
    path.write_bytes(data)
    with pytest.warns(LoadWarning, match="mesh.ply: left out: ") as caught:
        if in_parts:
            open_source(path, tmp_path / "work")
        else:
            load(path)
    [warning] = caught
    return str(warning.message).partition("left out: ")[2]


@pytest.mark.parametrize("in_parts", [False, True])
@pytest.mark.parametrize("fmt", ["ascii", BYTES, "binary_big_endian"])
def test_properties_and_elements(tmp_path: Path, fmt: str, in_parts: bool) -> None:
    properties = [*XYZ, ("float", "quality"), ("uchar", "alpha")]
    colored = [*FACE, ("uchar", "red"), ("int", "flags"), ("int", "material_index")]
    elements: list[Any] = [
        ("vertex", properties, [(*p, 0.5, 255) for p in POINTS]),
        ("face", colored, [([0, 1, 2], 255, 1, 0)]),
        ("edge", [("int", "a"), ("int", "b")], [(0, 1)]),
        ("camera", [("int", "a")], []),
    ]
    assert lost(tmp_path, ply_bytes(elements, fmt), in_parts) == (
        "quality, alpha of the element 'vertex'; red, flags of the element 'face'; "
        "the element 'edge'"
    )


@pytest.mark.parametrize("in_parts", [False, True])
def test_textures_in_comments(tmp_path: Path, in_parts: bool) -> None:
    data = ply_bytes([("vertex", XYZ, POINTS), ("face", FACE, [([0, 1, 2],)])], BYTES)
    data = data.replace(b"element vertex", b"comment TextureFile my wood.png\nelement vertex")
    assert lost(tmp_path, data, in_parts) == "the textures 'my wood.png'"


def test_coordinates_of_corners_that_not_all_faces_have(tmp_path: Path) -> None:
    properties = [*FACE, ("list", "uchar", "float", "texcoord")]
    rows = [([0, 1, 2], [0, 0, 1, 0, 0, 1]), ([2, 1, 0], [])]
    data = ply_bytes([("vertex", XYZ, POINTS), ("face", properties, rows)])
    assert lost(tmp_path, data) == "texcoord of the element 'face'"


def test_what_becomes_a_mesh_is_no_loss(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    named = [(n, "float") for n in ("nx", "ny", "nz", "s", "t", "tx", "ty", "tz", "tw")]
    properties = [*XYZ, *((kind, n) for n, kind in named)]
    properties += [("uchar", n) for n in ("red", "green", "blue", "alpha")]
    rows = [(*p, 0, 0, 1, 0, 0, 1, 0, 0, 1, 1, 2, 3, 4) for p in POINTS]
    face = [*FACE, ("int", "material_index")]
    data = ply_bytes([("vertex", properties, rows), ("face", face, [([0, 1, 2], 0)])])
    (tmp_path / "mesh.ply").write_bytes(data)
    load(tmp_path / "mesh.ply")
    assert not recwarn.list
