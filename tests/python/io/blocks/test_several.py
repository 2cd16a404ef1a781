"""Several files and meshes as one source: none is left out, whatever they say of themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import umbel
from umbel.geometry.mesh import Material
from umbel.io.blocks import open_source


def square(x: float) -> umbel.Mesh:
    corners = np.array([[x, 0, 0], [x + 1, 0, 0], [x + 1, 1, 0], [x, 1, 0]], np.float32)
    return umbel.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".obj"])
def test_all_files_are_read(tmp_path: Path, suffix: str) -> None:
    paths = [tmp_path / f"{k}{suffix}" for k in range(3)]
    for k, path in enumerate(paths):
        umbel.save(path, square(k))
    source = open_source(paths, tmp_path / "work")
    assert source.triangles.triangles == 6
    assert source.vertices == 12


def test_other_coordinates_are_warned_of(tmp_path: Path) -> None:
    paths = [tmp_path / "a.glb", tmp_path / "b.ply"]
    for path in paths:
        umbel.save(path, square(0))
    (tmp_path / "b.prj").write_text('LOCAL_CS["here",UNIT["foot",0.3048]]')
    with pytest.warns(umbel.LoadWarning, match="are read as the same"):
        source = open_source(paths, tmp_path / "work")
    assert source.triangles.triangles == 4


def test_meshes_keep_their_materials(tmp_path: Path) -> None:
    red, blue = Material(name="red"), Material(name="blue")
    meshes = []
    for k, materials in enumerate(([red, blue], [red, blue], [blue])):
        mesh = square(k)
        mesh.materials = materials
        mesh.material_ids = np.array([0, len(materials) - 1], np.uint32)
        meshes.append(mesh)
    source = open_source(meshes, tmp_path / "work")
    assert [material.name for material in source.materials] == ["red", "blue"]
    assert source.triangles.read(0, 6)["materials"].tolist() == [0, 1, 0, 1, 1, 1]


def test_further_attributes_are_refused_or_left_out(tmp_path: Path) -> None:
    mesh = square(0)
    mesh.uv_sets = [np.zeros((4, 2), np.float32)]
    for source in (mesh, [mesh]):
        with pytest.raises(umbel.Error, match=r"further sets of texture coordinates.*in memory"):
            open_source(source, tmp_path / "work")
        opened = open_source(source, tmp_path / "other", attributes=False)
        assert opened.triangles.triangles == 2


def test_negative_index_is_shown_as_it_is(tmp_path: Path) -> None:
    umbel.save(tmp_path / "a.ply", square(0))
    data = (tmp_path / "a.ply").read_bytes().replace(b"list uchar uint", b"list uchar int")
    assert b"list uchar int " in data
    (tmp_path / "a.ply").write_bytes(data[:-4] + b"\xff\xff\xff\xff")
    source = open_source(tmp_path / "a.ply", tmp_path / "work")
    with pytest.raises(umbel.Error, match="triangle 1 has vertex index -1, of 4"):
        source.triangles.read(0, 2)
