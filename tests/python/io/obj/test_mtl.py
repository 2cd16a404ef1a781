"""Material libraries: what becomes a material, and what is named where it does not."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from umbel.errors import LoadWarning
from umbel.io import load
from umbel.io.blocks import open_source
from umbel.io.references import references

OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl {}\nf 1/1 2/1 3/1\n"


def read(tmp_path: Path, library: str, name: str = "m") -> tuple[Any, list[str]]:
    """The material, and what the warnings say."""
    (tmp_path / "a.mtl").write_bytes(library.encode())
    (tmp_path / "a.obj").write_bytes(OBJ.format(name).encode())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        [material] = load(tmp_path / "a.obj").materials
    return material, [str(w.message) for w in caught]


def test_statements_that_are_left_out_are_named_once(tmp_path: Path) -> None:
    library = "newmtl m\nKa 1 1 1\nKs 1 1 1\nillum 2\nmap_Ns a.png\nKd xyz 1 1 1\nKs 0 0 0\n"
    _, said = read(tmp_path, library)
    assert said == [f"{tmp_path / 'a.mtl'}: left out: Ks, map_Ns, Kd xyz"]


def test_numbers_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    library = "newmtl m\nKd nan 0 0\nPm inf\nKe 1e400 0 0\nPr 0.5\nmap_Kd -o nan 0 -s 2 2 a.png\n"
    material, said = read(tmp_path, library)
    assert said == [f"{tmp_path / 'a.mtl'}: left out: Kd nan, Pm inf, Ke 1e400, map_Kd -o"]
    assert material.base_color == (1, 1, 1, 1) and material.roughness == 0.5
    assert material.textures["base_color"]["uri"] == "a.png"
    moved = material.textures["base_color"]["extensions"]["KHR_texture_transform"]
    assert moved == {"offset": [0, 1], "scale": [2, -2]}


def test_a_library_that_is_named_twice_is_read_once(tmp_path: Path) -> None:
    _, [said] = read(tmp_path, "newmtl m\nTf 1 0 0\n", "m\nmtllib a.mtl\nmtllib a.mtl")
    assert said.endswith("left out: Tf")


@pytest.mark.parametrize("line", ["mtllib a.mtl b.mtl", "mtllib a.mtl\nmtllib b.mtl"])
def test_of_several_libraries_the_first_counts(tmp_path: Path, line: str) -> None:
    (tmp_path / "b.mtl").write_text("newmtl m\nKd 0 1 0\nnewmtl n\nKd 0 0 1\nnewmtl both\n")
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0 0\nnewmtl both\n")
    faces = "".join(f"usemtl {name}\nf 1 2 3\n" for name in ("n", "both", "m"))
    (tmp_path / "a.obj").write_text(f"{line}\nv 0 0 0\nv 1 0 0\nv 1 1 0\n{faces}")
    with pytest.warns(LoadWarning) as caught:
        materials = load(tmp_path / "a.obj").materials
    assert [m.base_color[:3] for m in materials] == [(0, 0, 1), (1, 1, 1), (1, 0, 0)]
    [warning] = caught
    assert "several libraries have 'm': those of the first are taken" in str(warning.message)


def test_options_of_maps_that_are_left_out_are_named(tmp_path: Path) -> None:
    library = "newmtl m\nmap_Kd -mm 0.1 2 -o 1 -clamp on a.png\nnorm -bm 2 -imfchan r b.png\n"
    material, said = read(tmp_path, library)
    assert said == [f"{tmp_path / 'a.mtl'}: left out: map_Kd -mm, norm -imfchan"]
    assert material.textures["normal"]["scale"] == 2


def test_a_library_that_is_read_whole_says_nothing(tmp_path: Path) -> None:
    library = "newmtl m\nKd 1 0 0\nKe 1 1 1\nd 0.5\nTr 0.5\nNs 9\nPm 1\nPr 1\nPc 1\nPcr 0\nNi 1.4\n"
    library += "Ka 1 1 1\nKs 0.5 0.5 0.5\nillum 2\n"
    material, said = read(tmp_path, library + "map_Kd a.png\nmap_d a.png\nbump b.png\n")
    assert said == []
    assert material.extensions["KHR_materials_ior"] == {"ior": 1.4}


def test_a_material_without_a_name_is_one_of_its_own(tmp_path: Path) -> None:
    library = "newmtl m\nKd 1 0 0\nnewmtl\nKd 0 1 0\n"
    for name, color in (("m", (1, 0, 0, 1)), ("", (0, 1, 0, 1))):
        material, said = read(tmp_path, library, name)
        assert (material.base_color, said) == (color, [])


def test_statements_of_no_material_and_materials_that_are_replaced_are_named(
    tmp_path: Path,
) -> None:
    material, [said] = read(tmp_path, "Kd 0 0 1\nnewmtl m\nKd 1 0 0\nnewmtl m\nKd 0 1 0\n")
    assert material.base_color == (0, 1, 0, 1)
    assert said.endswith("left out: Kd, all but the last material 'm'")


@pytest.mark.parametrize("mode", ["L", "RGB", "I;16"])
def test_maps_of_heights_are_no_maps_of_normals(tmp_path: Path, mode: str) -> None:
    Image.new(mode, (300, 2), 99 if mode != "RGB" else (99, 104, 95)).save(tmp_path / "b.png")
    library = "newmtl m\nmap_Bump -bm 0.5 b.png\n"
    material, [said] = read(tmp_path, library)
    assert said.endswith("left out: map_Bump with a map of heights")
    assert not material.textures and not material.images
    material, [said] = read(tmp_path, "newmtl m\nnorm n.png\nbump b.png\n")
    assert material.textures["normal"]["uri"] == "n.png"
    Image.new("RGB", (2, 300), (120, 135, 250)).save(tmp_path / "b.png")
    material, said = read(tmp_path, library)
    assert (list(material.images), material.textures["normal"]["scale"], said) == (
        *(["normal"], 0.5, []),
    )


@pytest.mark.parametrize(
    ("lines", "alpha", "lost"),
    [
        ("Tr 0.25", 0.75, []),
        ("d 0.25\nTr 0.75", 0.25, []),
        ("d 1.0\nTr 1.0", 1.0, ["Tr 1.0"]),
        ("Tr 1.0\nd 1.0", 1.0, ["Tr 1.0"]),
        ("Tr 0.75\nd 0.25", 0.25, []),
        ("Tr 0.0\nd 0.25\nd 0.5", 0.5, ["Tr 0.0"]),
    ],
)
def test_opacity_counts_more_than_transparency(
    tmp_path: Path, lines: str, alpha: float, lost: list[str]
) -> None:
    material, said = read(tmp_path, f"newmtl m\n{lines}\n")
    assert material.base_color[3] == alpha
    assert material.alpha_mode == ("OPAQUE" if alpha == 1 else "BLEND")
    assert said == [f"{tmp_path / 'a.mtl'}: left out: {one}" for one in lost]


@pytest.mark.parametrize(
    ("lines", "emissive"),
    [
        ("map_Ke a.png", (1, 1, 1)),
        ("Ke 0.5 0 0\nmap_Ke a.png", (0.5, 0, 0)),
        ("map_Ke a.png\nKe 0 0 0", (0, 0, 0)),
        ("map_Ke gone.png", (0, 0, 0)),
        (f"map_Ke {'a' * 300}.png", (0, 0, 0)),
    ],
)
def test_a_map_of_emission_alone_shines(
    tmp_path: Path, lines: str, emissive: tuple[float, float, float]
) -> None:
    (tmp_path / "a.png").write_bytes(b"an image")
    material, said = read(tmp_path, f"newmtl m\n{lines}\n")
    assert (material.emissive, said) == (emissive, [])


def test_opacity_of_halos_is_opacity(tmp_path: Path) -> None:
    material, [said] = read(tmp_path, "newmtl m\nd -halo 0.25\n")
    assert (material.base_color[3], material.alpha_mode) == (0.25, "BLEND")
    assert said.endswith("left out: d -halo")


@pytest.mark.parametrize(
    "name",
    ["wall#1.png", "two words.png", '"quoted name.png"', "two  blanks.png", "a\u3000b\u00a0.png"],
)
def test_names_of_images(tmp_path: Path, name: str) -> None:
    material, _ = read(tmp_path, f"newmtl m # a comment\nmap_Kd -s 2 2 {name} # another\n")
    assert material.textures["base_color"]["uri"] == name.strip('"')
    named = references("a.mtl", (tmp_path / "a.mtl").read_bytes())
    assert named == [name.strip('"')]


def test_materials_that_no_library_has_are_named(tmp_path: Path) -> None:
    with pytest.warns(LoadWarning, match="do not have 1 of its materials: 'other'"):
        (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0 0\n")
        (tmp_path / "a.obj").write_text(OBJ.format("other"))
        assert load(tmp_path / "a.obj").materials[0].name == "other"


def test_a_library_that_is_not_there_is_named_whole(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ.replace("a.mtl", "../my wood.mtl").format("m"))
    with pytest.warns(LoadWarning) as caught:
        load(tmp_path / "a.obj")
    [warning] = caught
    assert "no material library: '../my wood.mtl' lies outside" in str(warning.message)


@pytest.mark.parametrize("name", ["m\u00a0", "a\u3000b", "a\u0085b", "a\u2028b", "a  b", "a\x1cb"])
def test_names_end_at_blanks_of_ascii_alone(tmp_path: Path, name: str) -> None:
    material, said = read(tmp_path, f"newmtl {name}\nPr 0.25\n", name)
    assert (material.name, material.roughness, said) == (name, 0.25, [])


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_end_as_they_do_anywhere(tmp_path: Path, end: str) -> None:
    material, said = read(tmp_path, end.join(["newmtl m", "Kd 1 \\", "0 0", "Pr 0.25", ""]))
    assert (material.base_color, material.roughness, said) == ((1, 0, 0, 1), 0.25, [])


@pytest.mark.parametrize(
    ("encoding", "names", "shown"),
    [
        ("gbk", ["屋", "门"], ["\xce\xdd", "\xc3\xc5"]),
        ("latin-1", ["caf\xe9", "caf\xe8"], ["caf\xe9", "caf\xe8"]),
        ("utf-8", ["caf\xe9", "门"], ["caf\xe9", "门"]),
    ],
)
@pytest.mark.parametrize("in_parts", [False, True])
def test_names_in_any_encoding_are_told_apart(
    tmp_path: Path, encoding: str, names: list[str], shown: list[str], in_parts: bool
) -> None:
    first, second = names
    library = f"newmtl {first}\nKd 1 0 0\nmap_Kd {first}.png\nnewmtl {second}\nKd 0 0 1\n"
    lines = [OBJ.format(first), f"usemtl {second}\nf 3/1 2/1 1/1\n"]
    image = tmp_path / os.fsdecode(f"{first}.png".encode(encoding))
    image.write_bytes(b"an image")
    (tmp_path / "a.mtl").write_bytes(library.encode(encoding))
    path = tmp_path / "a.obj"
    path.write_bytes("".join(lines).encode(encoding))
    materials = open_source(path, tmp_path / "work").materials if in_parts else load(path).materials
    assert [m.name for m in materials] == shown
    assert [m.base_color[:3] for m in materials] == [(1, 0, 0), (0, 0, 1)]
    assert materials[0].images["base_color"].encoded() == b"an image"
    assert materials[0].textures["base_color"]["uri"] == f"{shown[0]}.png"


@pytest.mark.parametrize(
    ("line", "lost"),
    [
        ("map_bump -bm a.png", "map_bump -bm"),
        ("map_bump -bm high a.png", "map_bump -bm"),
        ("map_Kd -clamp a.png", "map_Kd -clamp"),
        ("map_Kd -s a.png", "map_Kd -s"),
        ("d -halo", "d, d -halo"),
    ],
)
def test_statements_without_their_values_are_named(tmp_path: Path, line: str, lost: str) -> None:
    material, said = read(tmp_path, f"newmtl m\n{line}\nPr 0.25\n")
    assert said == [f"{tmp_path / 'a.mtl'}: left out: {lost}"]
    assert material.roughness == 0.25
    assert all(info["uri"].endswith("a.png") for info in material.textures.values())
