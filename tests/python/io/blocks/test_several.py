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


def test_files_without_normals_are_named(tmp_path: Path) -> None:
    paths = [tmp_path / "a.ply", tmp_path / "b.glb", tmp_path / "c.obj"]
    for path in paths:
        umbel.save(path, square(0))
    open_source(paths, tmp_path / "work")  # no warning where none has any
    mesh = square(0)
    mesh.normals = np.tile(np.float32([0, 0, 1]), (4, 1))
    umbel.save(paths[1], mesh)
    with pytest.warns(umbel.LoadWarning, match=r"a\.ply and 1 more have no normals, as others"):
        source = open_source(paths, tmp_path / "work")
    assert source.triangles.read(0, 2)["normals"].tolist() == [[0, 0, 0]] * 4


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


def rich(x: float) -> umbel.Mesh:
    mesh = square(x)
    mesh.tree = {
        "asset": {"copyright": "me"},
        "scenes": [{"nodes": [0], "extras": {"a": 1}, "name": "hall"}],
        "nodes": [{"name": "wall", "instances": [0, 1]}],
    }
    return mesh


def test_the_scene_of_a_single_file_is_kept(tmp_path: Path) -> None:
    umbel.save(tmp_path / "a.glb", rich(0))
    tree = open_source(tmp_path / "a.glb", tmp_path / "work").tree
    assert tree == umbel.load(tmp_path / "a.glb").tree
    assert (tree["nodes"][0]["name"], tree["asset"]["copyright"]) == ("wall", "me")


def test_what_is_lost_of_several_scenes_is_one_warning(tmp_path: Path) -> None:
    paths = [tmp_path / f"{k}.glb" for k in range(3)]
    for k, path in enumerate(paths):
        umbel.save(path, rich(k) if k else square(k))
    with pytest.warns(umbel.LoadWarning) as caught:
        source = open_source(paths, tmp_path / "work")
    [said] = [str(warning.message) for warning in caught]
    assert said.startswith(f"{paths[1]} and 1 more: left out, as all becomes one mesh: ")
    nodes = "names, extras and extensions of nodes"
    assert said.endswith(f"{nodes}; copyright; extras; names of the scene and its meshes")
    assert source.tree == {}


def test_files_outside_the_folder_are_read_where_that_is_allowed(tmp_path: Path) -> None:
    umbel.save(tmp_path / "a.gltf", square(0))
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "a.gltf"
    path.write_text((tmp_path / "a.gltf").read_text().replace('"a.bin"', '"../a.bin"'))
    with pytest.raises(umbel.Error, match="allow_outside=True"):
        open_source(path, tmp_path / "work")
    assert open_source(path, tmp_path / "work", allow_outside=True).triangles.triangles == 2
    built = umbel.build_lod(path, unit_triangles=1000, allow_outside=True)
    assert built.report["input_triangles"] == 2


def skinned(x: float) -> umbel.Mesh:
    mesh = square(x)
    mesh.uvs = np.zeros((4, 2), np.float32)
    mesh.uv_sets = [np.arange(8, dtype=np.float32).reshape(4, 2)]
    mesh.joints = np.tile(np.uint32([3, 1, 2, 70_000]), (4, 1))
    mesh.weights = np.tile(np.float32([0.5, 0.25, 0, 0.25]), (4, 1))
    return mesh


def test_further_sets_of_blocks_are_kept(tmp_path: Path) -> None:
    for source in (skinned(0), [skinned(0), skinned(1)]):
        block = open_source(source, tmp_path / "work").triangles.read(0, 2)
        assert block["extras"] == [(4, 1), (16, 0), (32, 0)]
        values = block["extra_values"].reshape(4, 10)
        # The last two corners come in the order of the triangles.
        assert sorted(values[:, 0].tolist()) == [0, 2, 4, 6]
        assert (values[:, 1] == values[:, 0] + 1).all()
        # A joint that moves nothing is 0.
        assert values[:, 2:].tolist() == [[3, 1, 0, 70_000, 0.5, 0.25, 0, 0.25]] * 4


def test_joints_of_two_files_are_not_mixed(tmp_path: Path) -> None:
    paths = [tmp_path / "a.glb", tmp_path / "b.glb"]
    for path in paths:
        mesh = skinned(0)
        assert mesh.joints is not None
        mesh.joints %= 8
        umbel.save(path, mesh)
    with pytest.raises(umbel.Error, match=r"b.glb has joints, and so has .*a.glb"):
        open_source(paths, tmp_path / "work")


def test_joints_that_no_float_holds_are_refused(tmp_path: Path) -> None:
    mesh = skinned(0)
    assert mesh.joints is not None
    mesh.joints[0, 0] = (1 << 24) + 1
    with pytest.raises(umbel.Error, match="has the joint 16777217"):
        open_source(mesh, tmp_path / "work")


def test_negative_index_is_shown_as_it_is(tmp_path: Path) -> None:
    umbel.save(tmp_path / "a.ply", square(0))
    data = (tmp_path / "a.ply").read_bytes().replace(b"list uchar uint", b"list uchar int")
    assert b"list uchar int " in data
    (tmp_path / "a.ply").write_bytes(data[:-4] + b"\xff\xff\xff\xff")
    source = open_source(tmp_path / "a.ply", tmp_path / "work")
    with pytest.raises(umbel.Error, match="triangle 1 has vertex index -1, of 4"):
        source.triangles.read(0, 2)
