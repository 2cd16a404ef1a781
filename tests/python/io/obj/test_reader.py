"""Reading OBJ: against a plain reader, and the odd files that are about."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.mesh_files import corners
from helpers.meshes import linear
from helpers.refusals import refused
from umbel import Bvh, KdTree, Material, TwoLevelGrid, build_lod, cluster_mesh, validate
from umbel.bvh import build_bvh2, build_kary, kmeans_times
from umbel.errors import Error, LoadWarning
from umbel.io import load
from umbel.io.blocks import open_source

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def read(tmp_path: Path, text: str) -> Any:
    path = tmp_path / "mesh.obj"
    path.write_text(text)
    return load(path)


def test_polygons_become_fans(tmp_path: Path) -> None:
    mesh = read(tmp_path, SQUARE + "f 1 2 3 4\nf 4 3 2\n")
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1]]
    assert np.array_equal(mesh.positions[2], [1, 1, 0])
    assert mesh.uvs is None
    assert mesh.normals is None


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    pattern=st.sampled_from(["v", "v/t", "v//n", "v/t/n", "mixed"]),
    negative=st.booleans(),
    interleaved=st.booleans(),
)
def test_any_mixture_reads_as_a_plain_reader_does(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    pattern: str,
    negative: bool,
    interleaved: bool,
) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 9))
    tables = {
        "v": rng.random((n, 3)).astype(np.float32),
        "vt": rng.random((n + int(rng.integers(0, 3)), 2)).astype(np.float32),
        "vn": rng.random((n + int(rng.integers(0, 3)), 3)).astype(np.float32),
    }
    tables["vn"] /= np.linalg.norm(tables["vn"], axis=1, keepdims=True)
    lines = [
        f"{key} " + " ".join(f"{x:.9g}" for x in row) for key, t in tables.items() for row in t
    ]
    if interleaved:
        order = np.random.default_rng(seed).permutation(len(lines))
        lines = [lines[k] for k in sorted(order, key=lambda k: (k % 3, k))]
        # Sorting by kind keeps each kind's own order, as indices need.
        lines = [x for key in ("vn", "v", "vt") for x in lines if x.split()[0] == key]
        for key in tables:
            tables[key] = np.array(
                [[np.float32(w) for w in x.split()[1:]] for x in lines if x.split()[0] == key]
            )
    expected = []
    for _ in range(int(rng.integers(1, 6))):
        size = int(rng.integers(3, 6))
        form = rng.choice(["v", "v/t", "v//n", "v/t/n"]) if pattern == "mixed" else pattern
        face = []
        words = []
        for _ in range(size):
            at = {key: int(rng.integers(0, len(t))) for key, t in tables.items()}
            shown = {
                key: str(at[key] - len(tables[key]) if negative else at[key] + 1) for key in tables
            }
            word = form.replace("t", shown["vt"]).replace("n", shown["vn"])
            words.append(word.replace("v", shown["v"]))
            face.append((at["v"], at["vt"] if "t" in form else None,
                         at["vn"] if "n" in form else None))  # fmt: skip
        lines.append("f " + " ".join(words))
        expected += [(face[0], face[k], face[k + 1]) for k in range(1, size - 1)]
    mesh = read(tmp_path_factory.mktemp("obj"), "\n".join([*lines, ""]))
    assert len(mesh.triangles) == len(expected)
    positions = mesh.world_positions.astype(np.float32)
    for triangle, want in zip(mesh.triangles, expected, strict=True):
        for vertex, (v, vt, vn) in zip(triangle, want, strict=True):
            assert np.array_equal(positions[vertex], tables["v"][v])
            if vt is not None:
                assert np.array_equal(mesh.uvs[vertex], tables["vt"][vt])
            if vn is not None:
                assert np.array_equal(mesh.normals[vertex], tables["vn"][vn])


def test_corners_share_vertices_where_all_their_indices_agree(tmp_path: Path) -> None:
    mesh = read(tmp_path, SQUARE + "vt 0 0\nvt 1 1\nf 1/1 2/1 3/2\nf 1/1 3/2 4/1\nf 1/2 2/1 4/1\n")
    assert len(mesh.positions) == 5
    assert mesh.triangles[0, 0] == mesh.triangles[1, 0] != mesh.triangles[2, 0]


def test_comments_blank_lines_continuations_and_windows_line_ends(tmp_path: Path) -> None:
    text = (
        "# 1\r\n\r\n  v 0 0 0 # a\r\nv 1 0 0\r\n\tv 0 1 0\r\nf 1 \\\r\n 2 3 # f 1 1 1\r\n#f 3 2 1"
    )
    mesh = read(tmp_path, text)
    assert mesh.triangles.tolist() == [[0, 1, 2]]
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    mesh = read(tmp_path, text.replace("\r\n", "\r"))
    assert mesh.triangles.tolist() == [[0, 1, 2]]


def test_vertex_colours_weights_and_missing_coordinates(tmp_path: Path) -> None:
    mesh = read(tmp_path, "v 0 0 0 1 0.5 0\nv 1 0 0 0 0 1\nv 0 1 0\nf 1 2 3\n")
    assert np.allclose(mesh.colors, [[1, linear(0.5), 0, 1], [0, 0, 1, 1], [1, 1, 1, 1]])
    assert read(tmp_path, "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").colors is None
    mesh = read(tmp_path, SQUARE + "vt 0.5\nvt 1 1 1\nf 1/1 2/2 3\n")
    assert mesh.uvs[mesh.triangles[0]].tolist() == [[0.5, 0], [1, 1], [0, 0]]


def test_colours_a_little_above_one_are_no_bytes(tmp_path: Path) -> None:
    mesh = read(tmp_path, "v 0 0 0 1.0001 0.5 0\nv 1 0 0 1 1 1\nv 0 1 0 0 0 0\nf 1 2 3\n")
    assert np.allclose(mesh.colors[0], [*linear([1.0001, 0.5, 0]), 1])
    mesh = read(tmp_path, "v 0 0 0 255 51 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n")
    assert np.allclose(mesh.colors[0], [*linear([1, 0.2, 0]), 1])


@pytest.mark.parametrize(
    ("colors", "expected"),
    [
        (["255 51 0 255", "0 0 255 51", "0 0 0 0"], [[1, 0.2, 0, 1], [0, 0, 1, 0.2], [0] * 4]),
        (["255 51 0 51", "0 0 255", ""], [[1, 0.2, 0, 0.2], [0, 0, 1, 1], [1] * 4]),
        (["1 0.2 0 0.5", "", "0 0 1"], [[1, 0.2, 0, 0.5], [1] * 4, [0, 0, 1, 1]]),
    ],
)
def test_bytes_have_alpha_in_bytes_and_what_has_no_colour_is_white(
    tmp_path: Path, colors: list[str], expected: list[list[float]]
) -> None:
    text = "".join(f"v {k} {k * k} 0 {color}\n" for k, color in enumerate(colors))
    wanted = np.array(expected, np.float32)
    wanted[:, :3] = linear(wanted[:, :3])
    mesh = read(tmp_path, text + "f 1 2 3\n")
    assert np.allclose(mesh.colors, wanted, atol=1e-6)
    native = open_source(tmp_path / "mesh.obj", tmp_path / "work").triangles
    block = native.read(0, native.triangles)
    assert np.allclose(block["colors"][block["triangles"][0]], wanted, atol=1e-6)


def test_corners_without_a_normal_get_one(tmp_path: Path) -> None:
    mesh = read(tmp_path, SQUARE + "vn 1 0 0\nf 1//1 2//1 3//1\nf 1 3 4\n")
    assert mesh.normals[mesh.triangles[0]].tolist() == [[1, 0, 0]] * 3
    assert mesh.normals[mesh.triangles[1]].tolist() == [[0, 0, 1]] * 3


def test_negative_indices_count_from_their_own_line(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\nv 6 5 5\nv 5 6 5\nf -3 -2 -1\n"
    assert read(tmp_path, text).triangles.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_materials_come_with_their_library(tmp_path: Path) -> None:
    (tmp_path / "two words.mtl").write_text(
        "newmtl red\nKd 1 0 0\nd 0.5\nKe 0 0 2\nPm 0.25\nPr 0.75\nmap_Kd a.png\n"
        "newmtl never\nKd 0 1 0\n"
    )
    mesh = read(
        tmp_path, "mtllib two words.mtl\n" + SQUARE
        + "f 1 2 3\nusemtl red\nf 1 2 3 4\nusemtl other\nf 1 2 3\nusemtl red\nf 4 3 2\n",
    )  # fmt: skip
    assert [m.name for m in mesh.materials] == ["red", "other", "default"]
    assert mesh.material_ids.tolist() == [2, 0, 0, 1, 0]
    assert mesh.materials[2] == Material(name="default")  # no metal, as others without statements
    parts = open_source(tmp_path / "mesh.obj", tmp_path / "work")
    assert parts.materials[2] == mesh.materials[2]
    red = mesh.materials[0]
    assert red.base_color == (1, 0, 0, 0.5)
    assert red.emissive == (0, 0, 2)
    assert (red.metallic, red.roughness, red.alpha_mode) == (0.25, 0.75, "BLEND")
    assert red.textures["base_color"]["uri"] == "a.png"


def test_a_missing_library_warns_and_names_stay(tmp_path: Path) -> None:
    with pytest.warns(LoadWarning, match="gone.mtl"):
        mesh = read(tmp_path, "mtllib gone.mtl\n" + SQUARE + "usemtl wood\nf 1 2 3\n")
    assert mesh.materials[0].name == "wood"


def test_faces_of_two_corners_warn(tmp_path: Path) -> None:
    with pytest.warns(LoadWarning, match="1 faces have fewer than three"):
        assert len(read(tmp_path, SQUARE + "f 1 2\nf 1 2 3\n").triangles) == 1


def test_vertices_beyond_the_list_pass_for_validation_to_find(tmp_path: Path) -> None:
    mesh = read(tmp_path, SQUARE + "vt 0 0\nf 1/1 2/1 9/1\nf 1/1 2/1 3/1\nf -9/1 1/1 2/1\n")
    assert (mesh.triangles >= len(mesh.positions)).any(axis=1).tolist() == [True, False, True]
    assert np.array_equal(corners_of(mesh, 1), [[0, 0, 0], [1, 0, 0], [1, 1, 0]])


def corners_of(mesh: Any, triangle: int) -> np.ndarray:
    part = type(mesh)(mesh.positions, mesh.triangles[triangle : triangle + 1])
    return corners(part)[0]


def test_what_holds_no_faces_is_no_mesh(tmp_path: Path) -> None:
    for text in ("# nothing\n", "v 1 2 3\n", "v 1 2 3\np 1\n", "\n\n"):
        with pytest.raises(Error, match="vertices and no faces: it is no mesh"):
            read(tmp_path, text)
    assert read(tmp_path, "# no faces\nv 1 2 3\n").positions.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize("text", ["hello world\n", "\n\nSTART\nv 1 2 3\n", "<html>\n<v>\n"])
def test_another_kind_of_text_is_refused_at_its_first_word(tmp_path: Path, text: str) -> None:
    line = text.count("\n", 0, len(text) - len(text.lstrip())) + 1
    with pytest.raises(Error, match=rf"mesh.obj, line {line}: .* is no statement of OBJ"):
        read(tmp_path, text)


def test_words_that_are_no_text_are_cited_all_the_same(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_bytes(SQUARE.encode() + b"f 1 2 gr\xfcn\n")
    says = "line 5: 'gr\N{REPLACEMENT CHARACTER}n' is no corner of a face"
    with pytest.raises(Error, match=says):
        load(path)
    with pytest.raises(Error, match=says):
        open_source(path, tmp_path / "work")


def test_a_vertex_that_is_not_there_is_named_as_written_and_its_remedy(tmp_path: Path) -> None:
    text = SQUARE + "vt 0 0\nf 1 2 3\nf 1/1 2/1 9/1\n"
    mesh = read(tmp_path, text)
    says = r"mesh.obj, line 7: vertex index 9 is beyond the 4 there are"
    with pytest.raises(Error, match=says) as caught:
        validate(mesh)
    assert caught.value.code == "invalid_mesh"
    with pytest.raises(Error, match=says + "; drop_invalid=True leaves"):
        build_lod(tmp_path / "mesh.obj")
    assert build_lod(mesh, drop_invalid=True).report["dropped_triangles"] == 1


def test_a_position_that_is_nan_is_named_with_its_file_and_the_remedy(tmp_path: Path) -> None:
    mesh = read(tmp_path, SQUARE.replace("v 1 1 0", "v 1 nan 0") + "f 1 2 3\n")
    with pytest.raises(Error, match=r"mesh.obj: triangle 0.*nan.*; drop_invalid=True leaves"):
        build_lod(mesh)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v 0 0 zero\n", "line 1: 'zero' is no number"),
        (SQUARE + "f 1 2 three\n", "line 5: 'three' is no corner of a face"),
        (SQUARE + "f 1 2 3.5\n", "line 5: '3.5' is no corner"),
        ("v 0 0\n", "line 1: 'v' has 2 numbers"),
        ("v 1\n", "line 1: 'v' has 1 numbers"),
        (SQUARE + "\nf 0 1 2\n", "line 6: vertex index 0"),
        (SQUARE + "vt 0 0\nf 1/2 2/1 3/1\n", "line 6: texture coordinate index 2 is beyond the 1"),
        (SQUARE + "vn 0 0 1\nf 1//1 2//1 3//-2\n", "line 6: normal index -2 is beyond the 1"),
        (SQUARE + "f 1/1/1/1 2 3\n", "line 5: '1/1/1/1' is no corner"),
        (SQUARE + "f 1,2,3 2 3\n", "line 5: '1,2,3' is no corner"),
        (SQUARE + "f 1 2 3\n" + "\0" * 40, "line 6: .* is no text"),
    ],
)
def test_damage_is_named_with_its_line(tmp_path: Path, text: str, says: str) -> None:
    with refused(says, "mesh.obj"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("l 1 2 3\np 1\n", "line 6: .* points and lines"),
        ("cstype bezier\n", "curves and surfaces"),
        ("vp 0.5\n", "curves and surfaces"),
        ("call more.obj\nusemap wood\n", "line 6: from here on 2 lines name other files .call"),
        ("sparkle 9\n", "line 6: .*'sparkle'"),
        ("f 3 2 1", "line 6: the last line has no end"),
    ],
)
def test_what_is_left_out_is_a_warning(tmp_path: Path, line: str, says: str) -> None:
    with pytest.warns(LoadWarning, match=says):
        mesh = read(tmp_path, SQUARE + "f 1 2 3\n" + line)
    assert mesh.triangles[0].tolist() == [0, 1, 2]


def test_packed_files_and_byte_order_marks_are_read(tmp_path: Path) -> None:
    text = b"\xef\xbb\xbf" + (SQUARE + "g a\no b\ns off\nf 1 2 3\n").encode()
    (tmp_path / "mesh.obj").write_bytes(text)
    (tmp_path / "mesh.obj.gz").write_bytes(gzip.compress(text))
    plain, packed = load(tmp_path / "mesh.obj"), load(tmp_path / "mesh.obj.gz")
    assert plain.triangles.tolist() == packed.triangles.tolist() == [[0, 1, 2]]


def test_coordinates_far_from_zero_keep_their_digits(tmp_path: Path) -> None:
    mesh = read(tmp_path, "v 500000.123 4000000.456 1\nv 500001.123 4000000.456 1\n"
                "v 500000.123 4000001.456 1\nf 1 2 3\n")  # fmt: skip
    assert np.abs(mesh.world_positions[0] - [500000.123, 4000000.456, 1]).max() < 1e-5


def test_maps_of_a_library_have_their_options(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text(
        "newmtl m\nPr 0.5\nNs 900\nPc 1\nmap_Kd -o 0.25 0.5 -s 2 4 -clamp on my wood.png\n"
        "norm -bm 0.5 -imfchan r bumps.png\n"
    )
    mesh = read(tmp_path, "mtllib a.mtl\n" + SQUARE + "vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    [material] = mesh.materials
    assert material.roughness == 0.5
    assert material.extensions == {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0}}
    color, normal = material.textures["base_color"], material.textures["normal"]
    assert (color["uri"], normal["uri"], normal["scale"]) == ("my wood.png", "bumps.png", 0.5)
    moved = color["extensions"]["KHR_texture_transform"]
    # v = 0.25 from the bottom: 4 * 0.25 + 0.5 = 1.5 from the image's bottom, -0.5 from its top.
    assert moved["offset"][1] + 0.25 * moved["scale"][1] == -0.5
    image = material.images["base_color"]
    assert (image.wrap_u, image.bottom_up, image.path) == ("clamp", False, tmp_path / "my wood.png")
    assert material.images["normal"].bottom_up


@pytest.mark.parametrize(
    "use",
    [Bvh, KdTree, TwoLevelGrid, cluster_mesh, build_bvh2, build_kary, kmeans_times],
    ids=lambda use: use.__name__,
)
def test_whatever_refuses_a_mesh_names_its_file(tmp_path: Path, use: Any) -> None:
    mesh = read(tmp_path, SQUARE + "f 1 2 3\nf 1 2 9\n")
    with pytest.raises(Error, match=r"mesh.obj, line 6: vertex index 9 is beyond the 4"):
        use(mesh)
    mesh = read(tmp_path, SQUARE.replace("v 1 1 0", "v 1 inf 0") + "f 1 2 3\n")
    with pytest.raises(Error, match=r"mesh.obj: .*(infinite|inf)"):
        use(mesh)


def test_objects_that_become_one_mesh_are_said(tmp_path: Path) -> None:
    two = SQUARE + "o left\ng left_default\nf 1 2 3\ng right # door\nf 3 4 1\ng unused\n"
    with pytest.warns(LoadWarning, match="its 2 objects and groups .'left_default', 'right'. bec"):
        assert len(read(tmp_path, two).triangles) == 2


def test_an_object_alone_is_no_loss(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    read(tmp_path, SQUARE + "o left\ng left_default\nf 1 2 3\nf 3 4 1\n")
    assert not recwarn.list
