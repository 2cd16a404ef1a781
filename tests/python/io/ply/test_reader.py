"""Reading PLY: every format, type and layout gives what a plain reader would."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES, ply_bytes
from helpers.meshes import linear
from helpers.refusals import refused
from umbel import validate
from umbel.errors import Error, LoadWarning
from umbel.io import load

FORMATS = ["ascii", "binary_little_endian", "binary_big_endian"]
XYZ = [("float", "x"), ("float", "y"), ("float", "z")]
FACE = [("list", "uchar", "int", "vertex_indices")]


def read(tmp_path: Path, data: bytes, name: str = "mesh.ply") -> Any:
    path = tmp_path / name
    path.write_bytes(data)
    return load(path)


def rows(array: Any) -> list[tuple[Any, ...]]:
    return [tuple(r) for r in np.asarray(array).tolist()]


def faces(polygons: Any) -> list[tuple[Any, ...]]:
    return [(list(p),) for p in polygons]


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_tetrahedron_is_read_in_every_format(tmp_path: Path, fmt: str, newline: str) -> None:
    mesh = read(
        tmp_path,
        ply_bytes(
            [("vertex", XYZ, rows(TETRA_POSITIONS)), ("face", FACE, faces(TETRA_TRIANGLES))],
            fmt,
            newline,
        ),
    )
    assert np.array_equal(mesh.positions, TETRA_POSITIONS)
    assert np.array_equal(mesh.triangles, TETRA_TRIANGLES)
    assert mesh.positions.dtype == np.float32
    assert mesh.triangles.dtype == np.uint32
    assert mesh.name == "mesh"
    assert mesh.normals is None
    assert mesh.uvs is None
    assert mesh.colors is None
    assert mesh.material_ids is None


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    "comment", ["made by \xc5ke".encode(), "\u5168\u666f".encode(), b"caf\xe9 \x85 \x1c \x1e \v\f"]
)
def test_comments_may_have_any_bytes(tmp_path: Path, comment: bytes, newline: str) -> None:
    text = ply_bytes(
        [("vertex", XYZ, rows(TETRA_POSITIONS)), ("face", FACE, faces(TETRA_TRIANGLES))],
        "ascii",
        newline,
    ).replace(b"made for a test", comment)
    assert comment in text
    assert np.array_equal(read(tmp_path, text).triangles, TETRA_TRIANGLES)


def test_names_of_properties_are_shown_as_text(tmp_path: Path) -> None:
    vertices = [(*row, 0.5) for row in rows(TETRA_POSITIONS)]
    properties = [
        *XYZ,
        ("float", "\xe0"),
    ]
    data = ply_bytes(
        [("vertex", properties, vertices), ("face", FACE, faces(TETRA_TRIANGLES))], "ascii"
    )
    with pytest.warns(LoadWarning, match="left out: \xe0 of the element 'vertex'"):
        assert len(read(tmp_path, data).triangles) == 4


@settings(max_examples=60, deadline=None)
@given(
    polygons=st.lists(st.lists(st.integers(0, 9), max_size=7), max_size=12),
    fmt=st.sampled_from(FORMATS),
    count_type=st.sampled_from(["uchar", "char", "ushort", "int", "uint"]),
    index_type=st.sampled_from(["uchar", "short", "ushort", "int", "uint"]),
    extras=st.booleans(),
)
def test_polygons_become_fans_whatever_stands_beside_them(
    tmp_path_factory: pytest.TempPathFactory,
    polygons: list[list[int]],
    fmt: str,
    count_type: str,
    index_type: str,
    extras: bool,
) -> None:
    positions = np.random.default_rng(3).random((10, 3)).astype(np.float32)
    index_list: tuple[str, ...] = ("list", count_type, index_type, "vertex_index")
    properties: list[tuple[str, ...]] = [index_list]
    face_rows: list[tuple[Any, ...]] = faces(polygons)
    if extras:
        properties = [("short", "flags"), index_list, ("list", "uchar", "float", "weights")]
        face_rows = [(7, p, [0.5] * (len(p) % 3)) for p in polygons]
    elements: list[Any] = [
        ("vertex", XYZ, rows(positions)),
        ("face", properties, face_rows),
        ("edge", [("int", "a"), ("int", "b")], [(1, 2)]),
    ]
    if extras:
        elements.insert(0, ("camera", [("double", "f"), ("list", "int", "int", "k")], [(1, [4])]))
    mesh = read(tmp_path_factory.mktemp("ply"), ply_bytes(elements, fmt))
    expected = [[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)]
    assert mesh.triangles.tolist() == expected
    assert np.array_equal(mesh.positions, positions)


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("kind", ["char", "uchar", "short", "ushort", "int", "uint", "double"])
def test_positions_of_any_scalar_type(tmp_path: Path, fmt: str, kind: str) -> None:
    points = np.array([[0, 1, 2], [100, 5, 6], [7, 99, 9]])
    mesh = read(
        tmp_path,
        ply_bytes(
            [
                ("vertex", [(kind, "x"), (kind, "y"), (kind, "z")], rows(points)),
                ("face", FACE, [([0, 1, 2],)]),
            ],
            fmt,
        ),
    )
    assert np.array_equal(mesh.positions, points.astype(np.float32))


@pytest.mark.parametrize("fmt", FORMATS)
def test_attributes_under_their_usual_names(tmp_path: Path, fmt: str) -> None:
    rng = np.random.default_rng(5)
    values = rng.random((3, 8)).astype(np.float32)
    normal = [0, 4, 5]
    values[:, normal] /= np.linalg.norm(values[:, normal], axis=1, keepdims=True)
    colors = rng.integers(0, 256, (3, 4))
    for uv in (("s", "t"), ("u", "v"), ("texture_u", "texture_v")):
        names = ["nx", "x", "y", "z", "ny", "nz", *uv]
        properties = [("float", n) for n in names]
        properties += [("uchar", n) for n in ("red", "green", "blue", "alpha")]
        table = [(*v, *c) for v, c in zip(values.tolist(), colors.tolist(), strict=True)]
        mesh = read(
            tmp_path,
            ply_bytes([("vertex", properties, table), ("face", FACE, [([0, 1, 2],)])], fmt),
        )
        assert np.array_equal(mesh.positions, values[:, 1:4])
        assert np.array_equal(mesh.normals, values[:, normal])
        assert np.array_equal(mesh.uvs, values[:, 6:])
        expected = colors / 255
        expected[:, :3] = linear(expected[:, :3])
        assert np.allclose(mesh.colors, expected, atol=1e-6)


def test_colours_without_alpha_are_opaque_and_floats_are_srgb_too(tmp_path: Path) -> None:
    properties = [*XYZ, ("float", "red"), ("float", "green"), ("float", "blue")]
    table = [(0, 0, 0, 0.25, 0.5, 1.0)] * 3
    mesh = read(tmp_path, ply_bytes([("vertex", properties, table), ("face", FACE, [])]))
    assert np.allclose(mesh.colors, [[*linear([0.25, 0.5, 1.0]), 1.0]] * 3)


@pytest.mark.parametrize(
    ("kind", "red", "expected"),
    [
        ("float", 1.001, 1.001),
        ("double", 51, 0.2),
        ("int", 51, 0.2),
        ("uint", 255, 1.0),
        ("ushort", 65535, 1.0),
        ("short", 51, 0.2),
        ("int", 2**31 - 1, 1.0),
    ],
)
@pytest.mark.parametrize("fmt", FORMATS)
def test_colours_are_bytes_where_their_type_cannot_tell(
    tmp_path: Path, fmt: str, kind: str, red: float, expected: float
) -> None:
    properties = [*XYZ, (kind, "red"), (kind, "green"), (kind, "blue")]
    table = [(0, 0, 0, red, 0, 0), (1, 0, 0, 0, 0, 0), (0, 1, 0, 0, 0, 0)]
    data = ply_bytes([("vertex", properties, table), ("face", FACE, [([0, 1, 2],)])], fmt)
    assert np.allclose(read(tmp_path, data).colors[0], [linear(expected), 0, 0, 1], atol=1e-6)


@pytest.mark.parametrize("fmt", FORMATS)
def test_strips_alternate_their_winding_and_restart_at_minus_one(tmp_path: Path, fmt: str) -> None:
    strip = [0, 1, 2, 3, -1, 4, 5, 6, 7, 8, -1, 1, 2]
    data = ply_bytes(
        [
            ("vertex", XYZ, [(k, k * k, 0) for k in range(9)]),
            ("tristrips", [("list", "int", "int", "vertex_indices")], [(strip,), ([2, 3, 4],)]),
        ],
        fmt,
    )
    expected = [[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7], [6, 7, 8], [2, 3, 4]]
    got = [np.roll(t, -t.argmin()).tolist() for t in read(tmp_path, data).triangles]
    assert got == [np.roll(t, -int(np.argmin(t))).tolist() for t in expected]


def test_material_indices_follow_their_polygon(tmp_path: Path) -> None:
    data = ply_bytes(
        [
            ("vertex", XYZ, rows(TETRA_POSITIONS)),
            ("face", [*FACE, ("int", "material_index")], [([0, 1, 2, 3], 2), ([0, 1, 2], 0)]),
        ]
    )
    mesh = read(tmp_path, data)
    assert mesh.material_ids.tolist() == [2, 2, 0]
    assert len(mesh.materials) == 3


@pytest.mark.parametrize("polygons", [[([0, 1, 2], 1)], [([0, 1, 2, 3], 1)], []])
def test_strips_beside_faces_with_materials_have_none_of_these(
    tmp_path: Path, polygons: list[Any]
) -> None:
    data = ply_bytes(
        [
            ("vertex", XYZ, rows(TETRA_POSITIONS)),
            ("face", [*FACE, ("int", "material_index")], polygons),
            ("tristrips", [("list", "int", "int", "vertex_indices")], [([0, 1, 2, 3],)]),
        ]
    )
    mesh = read(tmp_path, data)
    assert len(mesh.triangles) == sum(len(face) - 2 for face, _ in polygons) + 2
    if not polygons:
        assert mesh.material_ids is None
        return
    names = [mesh.materials[k].name for k in mesh.material_ids]
    assert names == ["material_1"] * (len(names) - 2) + ["default"] * 2


@pytest.mark.parametrize("fmt", FORMATS)
def test_corner_coordinates_split_vertices_only_at_seams(tmp_path: Path, fmt: str) -> None:
    properties = [*FACE, ("list", "uchar", "float", "texcoord")]
    table = [([0, 1, 2], [0, 0, 1, 0, 0, 1]), ([2, 1, 3], [0, 1, 0.5, 0.5, 1, 1])]
    mesh = read(
        tmp_path,
        ply_bytes([("vertex", XYZ, rows(TETRA_POSITIONS)), ("face", properties, table)], fmt),
    )
    assert len(mesh.positions) == 5  # vertex 1 has two coordinates, vertex 2 the same twice
    assert np.array_equal(
        mesh.positions[mesh.triangles], TETRA_POSITIONS[np.array([[0, 1, 2], [2, 1, 3]])]
    )
    assert mesh.uvs[mesh.triangles].reshape(2, 6).tolist() == [list(t[1]) for t in table]


def test_nan_and_wrong_indices_pass_for_validation_to_find(tmp_path: Path) -> None:
    for fmt in FORMATS:
        points = [(float("nan"), 0, 0), (float("inf"), 1, 0), (0, -float("inf"), 1)]
        data = ply_bytes([("vertex", XYZ, points), ("face", FACE, faces([[0, 1, 99]]))], fmt)
        mesh = read(tmp_path, data)
        assert np.isnan(mesh.positions[0, 0])
        assert mesh.positions[2, 1] == -np.inf
        assert mesh.triangles.tolist() == [[0, 1, 99]]
        data = ply_bytes([("vertex", XYZ, points), ("face", FACE, faces([[0, -1, 2]]))], fmt)
        assert read(tmp_path, data).triangles[0, 1] >= 3


def test_doubles_far_from_zero_are_kept(tmp_path: Path) -> None:
    properties = [("double", "x"), ("double", "y"), ("double", "z")]
    points = TETRA_POSITIONS.astype(float) * 0.001 + 6.4e6
    data = ply_bytes(
        [("vertex", properties, rows(points.tolist())), ("face", FACE, [([0, 1, 2],)])]
    )
    mesh = read(tmp_path, data)
    assert mesh.origin.any()
    assert np.abs(mesh.world_positions - points).max() < 1e-9


def test_a_byte_order_mark_is_stepped_over(tmp_path: Path) -> None:
    assert len(read(tmp_path, b"\xef\xbb\xbf" + ASCII).triangles) == 4


def test_gzip_is_unpacked(tmp_path: Path) -> None:
    data = ply_bytes([("vertex", XYZ, rows(TETRA_POSITIONS)), ("face", FACE, [([0, 1, 2],)])])
    mesh = read(tmp_path, gzip.compress(data), "tetra.ply.gz")
    assert len(mesh.triangles) == 1
    assert mesh.name == "tetra"


@pytest.mark.parametrize("fmt", FORMATS)
def test_no_vertices_and_no_faces_are_an_empty_mesh(tmp_path: Path, fmt: str) -> None:
    mesh = read(tmp_path, ply_bytes([("vertex", XYZ, []), ("face", FACE, [])], fmt))
    assert mesh.positions.shape == (0, 3)
    assert mesh.triangles.shape == (0, 3)
    with pytest.raises(Error, match="has 1 vertices and no element 'face': a point cloud"):
        read(tmp_path, ply_bytes([("vertex", XYZ, [(0, 0, 0)])], fmt))
    with pytest.warns(LoadWarning, match="has 1 vertices, and no triangles"):
        data = ply_bytes([("vertex", XYZ, [(0, 0, 0)]), ("face", FACE, [])], fmt)
        assert read(tmp_path, data).triangles.size == 0


@pytest.mark.parametrize("fmt", FORMATS)
def test_what_follows_the_last_element_is_a_warning(tmp_path: Path, fmt: str) -> None:
    points = rows(TETRA_POSITIONS)
    good = ply_bytes([("vertex", XYZ, points), ("face", FACE, faces(TETRA_TRIANGLES))], fmt)
    lying = good.replace(b"element face 4", b"element face 3")
    line, byte = good.count(b"\n"), len(good) - 13
    place, left = (f"line {line}", "4 numbers") if fmt == "ascii" else (f"byte {byte}", "13 bytes")
    with pytest.warns(LoadWarning, match=rf"mesh.ply, {place}: {left} after the last element"):
        assert len(read(tmp_path, lying).triangles) == 3


def test_faces_of_two_corners_and_indices_that_are_none_are_named(tmp_path: Path) -> None:
    points = rows(TETRA_POSITIONS)
    data = ply_bytes([("vertex", XYZ, points), ("face", FACE, [([0, 1],), ([0, 1, -7],)])])
    with pytest.warns(LoadWarning, match="1 faces have fewer than three corners"):
        mesh = read(tmp_path, data)
    with pytest.raises(Error, match=r"mesh.ply: face 1 has vertex index -7, of 4 there are"):
        validate(mesh)


def test_fractions_in_text_are_kept_whatever_type_is_declared(tmp_path: Path) -> None:
    kinds = [("double", name) for name in ("x", "y", "z", "red", "green", "blue")]
    points = [(0.5, 0, 0, 0.5, 1, 0), (1, 0.25, 0, 1, 1, 0), (0, 1, 0, 0, 1, 0)]
    face = [("list", "uchar", "double", "vertex_indices")]

    def text(corners: list[float]) -> bytes:
        made = ply_bytes([("vertex", kinds, points), ("face", face, [(corners,)])], "ascii")
        return made.replace(b"double", b"int")

    mesh = read(tmp_path, text([0, 1, 2]))
    assert mesh.positions.tolist() == [[0.5, 0, 0], [1, 0.25, 0], [0, 1, 0]]
    assert mesh.colors[0].tolist() == pytest.approx([float(linear(0.5)), 1, 0, 1])
    mesh = read(tmp_path, text([0, 1, 1.75]))
    with pytest.raises(Error, match=r"mesh.ply: face 0 has vertex index 1.75, of 3 there are"):
        validate(mesh)


def test_properties_of_one_name_are_a_warning(tmp_path: Path) -> None:
    points = [(0, 0, 0, 5), (1, 0, 0, 6), (0, 1, 0, 7)]
    twice = [*XYZ, ("float", "x")]
    data = ply_bytes([("vertex", twice, points), ("face", FACE, [([0, 1, 2],)])])
    with pytest.warns(LoadWarning, match="line 8: all but the last property 'x' are left out"):
        assert read(tmp_path, data).positions[:, 0].tolist() == [5, 6, 7]


def test_damage_in_text_is_named_with_its_line(tmp_path: Path) -> None:
    lines = ASCII.decode().split("\n")
    first = lines.index("end_header") + 1
    for k in (0, 2, 5):
        bad = [*lines]
        bad[first + k] = "1 x 2"
        with pytest.raises(Error, match=rf"mesh.ply, line {first + k + 1}: 'x' is no number"):
            read(tmp_path, "\n".join(bad).encode())
    bad = [*lines]
    bad[first + 5] = "3.5 0 1 2"
    with pytest.raises(
        Error, match=rf"line {first + 6}: a list of element 'face', row 1, has .*3.5"
    ):
        read(tmp_path, "\n".join(bad).encode())


GOOD = ply_bytes([("vertex", XYZ, rows(TETRA_POSITIONS)), ("face", FACE, faces(TETRA_TRIANGLES))])
ASCII = ply_bytes(
    [("vertex", XYZ, rows(TETRA_POSITIONS)), ("face", FACE, faces(TETRA_TRIANGLES))], "ascii"
)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (GOOD[:-1], "cut short.*4 of element 'face', the data holds 3"),
        (GOOD[:-60], "cut short.*element 'vertex'"),
        (GOOD[:100], "end_header"),
        (ASCII[:-8], "cut short"),
        (ASCII.replace(b"1.0 0.0 0.0", b"1.0 zero 0.0"), "'zero' is no number"),
        (ASCII.replace(b"0.0 0.0 0.0", b"0.0 0.0 0.0 2.0"), "line 11: the line has 4 numbers"),
        (ASCII.replace(b"3 0 ", b"3 0 0 ", 1), "line 15: the line has 5 numbers"),
        (GOOD.replace(b"element vertex 4", b"element vertex 999999999999999999"), "vertex"),
        (GOOD.replace(b"element face 4", b"element face 4000000000"), "face"),
        (ASCII.replace(b"element face 4", b"element face 4000000000"), "face"),
        (GOOD.replace(b"element face 4", b"element face -4"), "header line"),
        (GOOD.replace(b"float x", b"quad x"), "header line 'property quad x'"),
        (GOOD.replace(b"float x", b"float w"), "lacks x, y or z"),
        (GOOD.replace(b"element vertex", b"element points"), "no element 'vertex'"),
        (GOOD.replace(b"binary_little_endian", b"binary_middle_endian"), "header line"),
        (GOOD.replace(b"vertex_indices", b"loop_indices__"), "no list 'vertex_indices'"),
    ],
)
def test_damage_is_named(tmp_path: Path, data: bytes, says: str) -> None:
    with refused(says, "mesh.ply"):
        read(tmp_path, data)


def test_huge_list_counts_do_not_allocate(tmp_path: Path) -> None:
    face = [("list", "uint", "int", "vertex_indices")]
    data = bytearray(ply_bytes([("vertex", XYZ, rows(TETRA_POSITIONS)),
                                ("face", face, faces([[0, 1, 2], [1, 2, 3]]))]))  # fmt: skip
    data[-16:-12] = b"\xff\xff\xff\xff"
    with pytest.raises(Error, match="cut short"):
        read(tmp_path, bytes(data))
