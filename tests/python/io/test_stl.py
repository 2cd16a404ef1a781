"""Reading STL, binary and ASCII."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES, corners
from helpers.refusals import refused
from umbel.errors import LoadWarning
from umbel.io import load
from umbel.io.blocks import open_source

CORNERS = TETRA_POSITIONS[TETRA_TRIANGLES]


def binary(points: np.ndarray = CORNERS, head: bytes = b"made for a test") -> bytes:
    records = np.zeros(len(points), [("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")])
    records["p"] = points
    return head.ljust(80, b"\0") + len(points).to_bytes(4, "little") + records.tobytes()


def ascii_text(points: np.ndarray = CORNERS) -> str:
    out = ["solid a vertex of doubt"]
    for triangle in points.tolist():
        out += ["  facet normal 0 0 1", "    outer loop"]
        out += [f"      vertex {x!r} {y!r} {z!r}" for x, y, z in triangle]
        out += ["    endloop", "  endfacet"]
    return "\n".join([*out, "endsolid"]).replace("solid a vertex of doubt", "solid made")


def read(tmp_path: Path, data: bytes, name: str = "mesh.stl") -> Any:
    path = tmp_path / name
    path.write_bytes(data)
    return load(path)


def test_binary_and_ascii_give_the_same_triangles(tmp_path: Path) -> None:
    for data in (
        binary(),
        binary(head=b"solid but binary facet"),
        binary() + b"trailing",
        ascii_text().encode(),
        ascii_text().upper().encode(),
        b"\xef\xbb\xbf" + ascii_text().encode(),
        ascii_text().replace("\n", "\r\n").encode(),
        ascii_text().replace("\n", " ").encode(),
        (ascii_text(CORNERS[:2]) + "\n" + ascii_text(CORNERS[2:]) + "\n").encode(),
    ):
        mesh = read(tmp_path, data)
        assert np.array_equal(corners(mesh), CORNERS)
        assert len(mesh.positions) == 12


@pytest.mark.parametrize("name", ["facet plate", "my solid part ", "Solid 1", "a facet normal"])
@pytest.mark.parametrize("end", ["\n", " "])
def test_names_of_solids_may_be_words_of_stl(tmp_path: Path, name: str, end: str) -> None:
    text = ascii_text() + "\n"
    text = text.replace("endsolid\n", f"endsolid {name}\n").replace("solid made", f"solid {name}")
    mesh = read(tmp_path, (text + text).replace("\n", end).encode())
    assert np.array_equal(corners(mesh), np.concatenate([CORNERS, CORNERS]))


@pytest.mark.parametrize(("more", "says"), [(b"x", "no whole one"), (bytes(100), "2 more")])
def test_bytes_after_the_last_triangle_are_a_warning(
    tmp_path: Path, more: bytes, says: str
) -> None:
    with pytest.warns(LoadWarning, match=f"{len(more)} bytes after the 4 .* byte 284 .*{says}"):
        assert len(read(tmp_path, binary() + more).triangles) == 4


@pytest.mark.parametrize("in_parts", [False, True])
def test_attributes_of_triangles_are_named(tmp_path: Path, in_parts: bool) -> None:
    path = tmp_path / "mesh.stl"
    path.write_bytes(binary()[:-2] + b"\x1f\x80")
    with pytest.warns(LoadWarning, match="mesh.stl: left out: the attributes of triangles"):
        if in_parts:
            open_source(path, tmp_path / "work")
        else:
            load(path)


@pytest.mark.parametrize("in_parts", [False, True])
def test_a_colour_in_the_header_is_named(tmp_path: Path, in_parts: bool) -> None:
    path = tmp_path / "mesh.stl"
    path.write_bytes(binary(head=b"COLOR=\xff\0\0\xff,MATERIAL="))
    with pytest.warns(LoadWarning, match="mesh.stl: left out: the colour in its header$"):
        if in_parts:
            open_source(path, tmp_path / "work")
        else:
            load(path)


@pytest.mark.parametrize("head", [b"ply stl converter", b"glTF stl converter", b"ply\n"])
def test_a_header_may_begin_as_another_format(tmp_path: Path, head: bytes) -> None:
    assert np.array_equal(corners(read(tmp_path, binary(head=head))), CORNERS)


def test_a_header_that_is_a_sentence_about_ply_is_none_of_ply(tmp_path: Path) -> None:
    with pytest.warns(LoadWarning, match="1 bytes after the 4 triangles"):
        mesh = read(tmp_path, binary(head=b"ply stl converter") + b"x")
    assert np.array_equal(corners(mesh), CORNERS)


def test_solids_that_become_one_mesh_are_said(tmp_path: Path) -> None:
    with pytest.warns(LoadWarning, match="mesh.stl: its 2 solids become one mesh"):
        read(tmp_path, (ascii_text() + "\n" + ascii_text()).encode())


def test_many_solids_take_no_square_of_time(tmp_path: Path) -> None:
    count = 200_000
    begin = time.process_time()
    with pytest.warns(LoadWarning, match=f"its {count} solids become one mesh"):
        read(tmp_path, b"solid\nendsolid\n" * count)
    assert time.process_time() - begin < 20


def test_no_triangles_are_an_empty_mesh(tmp_path: Path) -> None:
    assert read(tmp_path, binary(CORNERS[:0])).triangles.shape == (0, 3)
    assert read(tmp_path, b"solid nothing\nendsolid nothing\n").triangles.shape == (0, 3)


def test_a_text_may_be_padded(tmp_path: Path) -> None:
    padded = read(tmp_path, ascii_text().encode() + b"\n\x1a\0\0")
    assert np.array_equal(padded.positions, read(tmp_path, ascii_text().encode()).positions)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (binary()[:-1], "says 4 triangles, there are bytes for 3"),
        (binary()[:84].replace(b"\4\0\0\0", b"\xff\xff\xff\xff"), "says 4294967295 triangles"),
        (b"\0" * 50, "at least 84 bytes"),
        (ascii_text().replace("vertex 1.0", "vertex one", 1).encode(), "'one' is no number"),
        (ascii_text().replace("vertex 1.0", "vertex one", 1).encode(), "line 6: 'one'"),
        (ascii_text().rsplit("vertex", 1)[0].encode(), "line 26: there is no 'endsolid'"),
        (ascii_text().rsplit("  facet", 1)[0].encode(), "no 'endsolid'; the file is cut short"),
        (ascii_text().replace("endsolid", "").encode(), "no 'endsolid'"),
        (ascii_text().replace("outer loop", "", 1).encode(), "line 4: 'vertex' is where 'outer'"),
        (ascii_text().replace("endloop", "vertex 1 2 3", 1).encode(), "line 7: .*'endloop' should"),
        (ascii_text().replace("  endfacet", "  endfacet x", 3).encode(), "line 8: 'x' is where 'f"),
        (
            ascii_text().replace("    endloop\n  endfacet\nends", "ends").encode(),
            "facet is cut short",
        ),
        (ascii_text().encode() + b"\nfacet 1", "line 31: 'facet' follows the last 'endsolid'"),
        (ascii_text().replace("vertex 1.0", "vertex 1_0", 1).encode(), "line 6: '1_0' is no"),
        (b"solid a\nsolid b\nendsolid\n", "line 2: .* do not take turns"),
        (b"hello world\n" * 20, "is cut short or no STL"),
        (b"hello world\n", "is cut short or no STL"),
        (b"\0" * 90, "says 0 triangles, and 6 bytes follow"),
    ],
)
def test_damage_is_named(tmp_path: Path, data: bytes, says: str) -> None:
    with refused(says, "mesh.stl"):
        read(tmp_path, data)
