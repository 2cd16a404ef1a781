"""Reading OBJ: against a plain reader, and the odd files that are about."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from io_helpers import corners
from umbel.errors import Error, LoadWarning
from umbel.io import load

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
    mesh = read(tmp_path_factory.mktemp("obj"), "\n".join(lines))
    assert len(mesh.triangles) == len(expected)
    for triangle, want in zip(mesh.triangles, expected, strict=True):
        for vertex, (v, vt, vn) in zip(triangle, want, strict=True):
            assert np.array_equal(mesh.positions[vertex], tables["v"][v])
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
    assert mesh.colors.tolist() == [[1, 0.5, 0, 1], [0, 0, 1, 1], [1, 1, 1, 1]]
    assert read(tmp_path, "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").colors is None
    mesh = read(tmp_path, SQUARE + "vt 0.5\nvt 1 1 1\nf 1/1 2/2 3\n")
    assert mesh.uvs[mesh.triangles[0]].tolist() == [[0.5, 0], [1, 1], [0, 0]]


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


def test_nothing_but_comments_is_an_empty_mesh(tmp_path: Path) -> None:
    assert read(tmp_path, "# nothing\n").triangles.shape == (0, 3)
    assert read(tmp_path, "v 1 2 3\n").positions.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v 0 0 zero\n", "line 1: 'zero' is no number"),
        (SQUARE + "f 1 2 three\n", "line 5: 'three' is no number"),
        (SQUARE + "f 1 2 3.5\n", "line 5: '3.5' is no number"),
        ("v 0 0\n", "line 1: 'v' has 2 numbers"),
        ("v 1\n", "line 1: 'v' has 1 numbers"),
        (SQUARE + "\nf 0 1 2\n", "line 6: vertex index 0"),
        (SQUARE + "vt 0 0\nf 1/2 2/1 3/1\n", "line 6: a texture coordinate index is beyond the 1"),
        (SQUARE + "vn 0 0 1\nf 1//1 2//1 3//-2\n", "line 6: a normal index is beyond the 1"),
        (SQUARE + "f 1/1/1/1 2 3\n", "no number|make no sense"),
        (SQUARE + "f 1,2,3 2 3\n", "line 5: '1,2,3' is no number"),
    ],
)
def test_damage_is_named_with_its_line(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(Error, match=says) as caught:
        read(tmp_path, text)
    assert "mesh.obj" in str(caught.value)
