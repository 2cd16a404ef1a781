"""What a file refers to: buffers, images and material libraries, and which of them are read."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.gltf_builder import GltfBuilder
from umbel import build_lod, build_scene
from umbel.errors import Error, LoadWarning
from umbel.io import load, load_scene

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\n"


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """A folder of assets and one beside it."""
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    return inside, outside


def gltf(buffer: str, image: str = "") -> tuple[bytes, bytes]:
    """A .gltf and the buffer that it names."""
    b = GltfBuilder()
    mesh = b.tetra()
    b.root["meshes"][mesh]["primitives"][0]["material"] = 0
    b.root["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    b.root["textures"] = [{"source": 0}]
    b.root["images"] = [{"uri": image or "none.png"}]
    b.scene(b.node(mesh=mesh))
    return b.gltf(buffer), bytes(b.data)


LEADING_OUT = [
    "../outside/a.bin",
    "sub/../../outside/a.bin",
    "%2e%2e/outside/a.bin",
    "%2E%2E%2Foutside%2Fa.bin",
    "..%5Coutside%5Ca.bin",
    "..\\outside\\a.bin",
    "{outside}/a.bin",
    "file://{outside}/a.bin",
    "link/a.bin",
    "linked.bin",
]


@pytest.mark.parametrize("uri", LEADING_OUT)
def test_buffers_outside_the_folder_are_refused_unless_allowed(
    folders: tuple[Path, Path], uri: str
) -> None:
    inside, outside = folders
    (inside / "sub").mkdir()
    (inside / "link").symlink_to(outside)
    (inside / "linked.bin").symlink_to(outside / "a.bin")
    text, data = gltf(uri.format(outside=outside))
    (outside / "a.bin").write_bytes(data)
    path = inside / "a.gltf"
    path.write_bytes(text)
    for read in (load, load_scene, build_lod, build_scene):
        with pytest.raises(Error, match="allow_outside=True") as caught:
            read(path)
        assert "a.gltf: buffers[0]" in str(caught.value)
    assert len(load(path, allow_outside=True).triangles) == 4
    assert build_lod(path, allow_outside=True).source["triangles"] == 4
    assert len(build_scene(path, allow_outside=True).lods) == 1


@pytest.mark.parametrize("uri", ["a.bin", "./a.bin", "sub/../a.bin", "sub%2Fb.bin", "inner/a.bin"])
def test_buffers_inside_the_folder_are_read(folders: tuple[Path, Path], uri: str) -> None:
    inside, _ = folders
    text, data = gltf(uri)
    (inside / "sub").mkdir()
    (inside / "inner").symlink_to(inside)
    (inside / "a.bin").write_bytes(data)
    (inside / "sub" / "b.bin").write_bytes(data)
    (inside / "a.gltf").write_bytes(text)
    assert len(load(inside / "a.gltf").triangles) == 4


@pytest.mark.parametrize("uri", ["sub", "http://127.0.0.1/a.bin", "%00", "loop", "//host/a.bin"])
def test_what_is_no_file_is_refused_whatever_is_allowed(
    folders: tuple[Path, Path], uri: str
) -> None:
    inside, _ = folders
    (inside / "sub").mkdir()
    (inside / "loop").symlink_to(inside / "loop")
    (inside / "a.gltf").write_bytes(gltf(uri)[0])
    for allowed in (False, True):
        with pytest.raises(Error, match=r"a.gltf: buffers\[0\]"):
            load(inside / "a.gltf", allow_outside=allowed)


def image_of(mesh: Any) -> Any:
    return mesh.materials[0].images.get("base_color")


def test_images_outside_the_folder_are_left_out_with_a_warning(folders: tuple[Path, Path]) -> None:
    inside, outside = folders
    (outside / "a.png").write_bytes(b"an image")
    (inside / "a.gltf").write_bytes(gltf("", "../outside/a.png")[0])
    (inside / "a.mtl").write_text("newmtl m\nmap_Kd ../outside/a.png\n")
    (inside / "a.obj").write_text(f"mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")
    for name in ("a.gltf", "a.obj"):
        with pytest.warns(LoadWarning, match=r"outside/a.png.*allow_outside=True"):
            assert image_of(load(inside / name)) is None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            image = image_of(load(inside / name, allow_outside=True))
        assert image.path.read_bytes() == b"an image"


def test_libraries_outside_the_folder_are_left_out_with_a_warning(
    folders: tuple[Path, Path],
) -> None:
    inside, outside = folders
    (outside / "a.mtl").write_text("newmtl m\nKd 1 0 0\n")
    (inside / "a.obj").write_text(f"mtllib ../outside/a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")
    with pytest.warns(LoadWarning, match=r"library: '../outside/a.mtl' lies outside"):
        assert load(inside / "a.obj").materials[0].base_color == (1, 1, 1, 1)
    mesh = load(inside / "a.obj", allow_outside=True)
    assert mesh.materials[0].base_color == (1, 0, 0, 1)


def test_textures_outside_the_folder_are_one_warning(tmp_path: Path) -> None:
    library = "".join(f"newmtl m{k}\nmap_Kd C:\\{k}.png\nmap_Ke ../e.png\n" for k in range(3))
    (tmp_path / "a.mtl").write_text(library)
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{SQUARE}usemtl m0\nf 1 2 3\n")
    with pytest.warns(LoadWarning) as caught:
        load(tmp_path / "a.obj")
    [warning] = caught
    said = str(warning.message)
    assert said.startswith(f"{tmp_path / 'a.mtl'}: material 'm0' loses its base_color texture: ")
    assert said.endswith("allow_outside=True; and 5 more")


def test_images_of_a_library_in_a_folder_below_may_lie_beside_the_mesh(
    folders: tuple[Path, Path],
) -> None:
    inside, _ = folders
    (inside / "sub").mkdir()
    (inside / "a.png").write_bytes(b"an image")
    (inside / "sub" / "a.mtl").write_text("newmtl m\nmap_Kd ../a.png\n")
    (inside / "a.obj").write_text(f"mtllib sub\\a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = load(inside / "a.obj")
    assert image_of(mesh).path.read_bytes() == b"an image"
    assert np.isfinite(mesh.positions).all()


def test_a_name_that_no_file_system_takes_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "scene.gltf"
    path.write_bytes(gltf("A" * 5000)[0])
    with pytest.raises(Error, match=r"scene\.gltf.*does not exist"):
        load(path)
