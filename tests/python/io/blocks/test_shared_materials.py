"""Materials of sources: with their images; equal ones of several files are one."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest

import umbel
from umbel.errors import LoadWarning
from umbel.io.blocks import open_source
from umbel.io.blocks.shared_materials import SharedMaterials
from umbel.io.textures.images import TextureImage

PNG = b"\x89PNG\r\n\x1a\n"


def material(name: str, data: bytes = PNG, **fields: float) -> umbel.Material:
    image = TextureImage(data=data)
    return umbel.Material(name, textures={"base_color": {}}, images={"base_color": image}, **fields)


def tile(path: Path, x: float, materials: list[umbel.Material]) -> Path:
    """A strip of two triangles for each material."""
    count = len(materials)
    row = np.arange(count + 1, dtype=np.float32)
    positions = np.stack([np.repeat(row, 2) + x, np.tile([0, 1], count + 1), 0 * np.repeat(row, 2)])
    first = 2 * np.arange(count)[:, None, None]
    mesh = umbel.Mesh(
        positions.T.astype(np.float32),
        np.add(first, [[0, 2, 3], [0, 3, 1]]).reshape(-1, 3).astype(np.uint32),
        uvs=np.zeros((2 * count + 2, 2), np.float32),
        material_ids=np.repeat(np.arange(count, dtype=np.uint32), 2),
        materials=materials,
    )
    umbel.save(path, mesh)
    return path


def names(files: list[Path], work: Path) -> list[str]:
    return [found.name for found in open_source(files, work).materials]


@pytest.mark.parametrize("extension", [".glb", ".gltf"])
def test_tiles_share_their_materials(tmp_path: Path, extension: str) -> None:
    first = tile(tmp_path / f"a{extension}", 0, [material("wall"), material("roof")])
    second = tile(tmp_path / f"b{extension}", 2, [material("grass"), material("wall")])
    assert names([first, second], tmp_path / "work") == ["wall", "roof", "grass"]


def test_what_differs_stays_apart() -> None:
    shared = SharedMaterials()
    shared.add([material("wall")])
    others = [
        material("roof"),
        material("wall", PNG + b"other"),
        material("wall", roughness=0.5),
        umbel.Material("wall"),
    ]
    assert shared.add(others) == [1, 2, 3, 4]
    assert shared.add([material("wall"), *others]) == [0, 1, 2, 3, 4]


def test_one_file_keeps_its_own_twice() -> None:
    shared = SharedMaterials()
    assert shared.add([material("wall"), material("wall")]) == [0, 1]


def test_a_file_of_the_same_bytes_is_the_same_image(tmp_path: Path) -> None:
    images = []
    for name in ("a.png", "b.png", "c.png"):
        (tmp_path / name).write_bytes(PNG + (b"c" if name == "c.png" else b""))
        images.append({"base_color": TextureImage(path=tmp_path / name)})
    shared = SharedMaterials()
    found = [shared.add([umbel.Material(images=image)])[0] for image in images]
    assert found == [0, 0, 1]


def test_an_unreadable_image_is_equal_to_itself_only(tmp_path: Path) -> None:
    shared = SharedMaterials()
    missing = [umbel.Material(images={"base_color": TextureImage(path=tmp_path / n)}) for n in "ab"]
    assert [shared.add([one])[0] for one in (*missing, missing[0])] == [0, 1, 0]


def test_equal_ones_of_many_files() -> None:
    shared = SharedMaterials()
    a, b, c, d = (umbel.Material(name=name) for name in "abcd")
    assert shared.add([a, b, b]) == [0, 1, 2]
    assert shared.add([c, b, c]) == [3, 1, 4]
    assert shared.add([d, c, a]) == [5, 3, 0]
    assert [m.name for m in shared.all] == ["a", "b", "b", "c", "c", "d"]


@pytest.mark.parametrize("extension", [".glb", ".obj", ".ply"])
def test_tiles_of_some_of_the_materials(tmp_path: Path, extension: str) -> None:
    """In any order: equal ones are one, and triangles keep theirs."""
    a, b, c = (umbel.Material(name=f"material_{k}", roughness=1 - k / 4) for k in range(3))
    files = [
        tile(tmp_path / f"{k}{extension}", 4 * k, materials)
        for k, materials in enumerate(([a], [a, b, c], [c, a, b], [b, a]))
    ]
    source = open_source(files, tmp_path / "work")
    assert [m.name for m in source.materials] == ["material_0", "material_1", "material_2"]
    found = source.triangles.read(0, source.triangles.triangles)["materials"].tolist()
    # PLY has no names: they are the numbers.
    wanted = [0, 0, 1, 2, 2, 0, 1, 1, 0] if extension != ".ply" else [0, 0, 1, 2, 0, 1, 2, 0, 1]
    assert found[::2] == wanted


def test_clusters_span_tiles_of_one_material(tmp_path: Path) -> None:
    files = [tile(tmp_path / f"{k}.glb", 4 * k, [material("wall")] * 1) for k in range(3)]
    umbel.build_asset(files, tmp_path / "out.umbel")
    asset = umbel.Asset(tmp_path / "out.umbel")
    assert [m.name for m in asset.materials] == ["wall"]


def as_data_uri(path: Path) -> None:
    """The buffer of a .gltf inside of it."""
    root = json.loads(path.read_text())
    data = path.with_suffix(".bin").read_bytes()
    root["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(data).decode()
    path.write_text(json.dumps(root))


@pytest.mark.parametrize("name", ["a.glb", "a.gltf", "inside.gltf"])
def test_images_are_read(tmp_path: Path, name: str) -> None:
    path = tile(tmp_path / name, 0, [material("wall", PNG + b"wall"), material("roof")])
    if name == "inside.gltf":
        as_data_uri(path)
    found = open_source(path, tmp_path / "work").materials
    images = [m.images["base_color"].encoded() for m in found]
    assert images == [PNG + b"wall", PNG]


def test_an_image_in_a_buffer_of_its_own_inside_the_json(tmp_path: Path) -> None:
    path = tile(tmp_path / "a.gltf", 0, [material("wall")])
    root = json.loads(path.read_text())
    uri = "data:;base64," + base64.b64encode(PNG).decode()
    root["buffers"].append({"byteLength": len(PNG), "uri": uri})
    root["bufferViews"].append({"buffer": 1, "byteLength": len(PNG)})
    root["images"] = [{"bufferView": len(root["bufferViews"]) - 1, "mimeType": "image/png"}]
    path.write_text(json.dumps(root))
    (found,) = open_source(path, tmp_path / "work").materials
    assert found.images["base_color"].encoded() == PNG


def test_an_image_that_is_not_there_is_said(tmp_path: Path) -> None:
    path = tile(tmp_path / "a.gltf", 0, [material("wall")])
    root = json.loads(path.read_text())
    root["bufferViews"].append({"buffer": 0, "byteOffset": 1 << 20, "byteLength": 16})
    root["images"] = [{"bufferView": len(root["bufferViews"]) - 1, "mimeType": "image/png"}]
    path.write_text(json.dumps(root))
    with pytest.warns(LoadWarning, match=r"a\.gltf: left out: an image"):
        open_source(path, tmp_path / "work")


def test_an_asset_has_the_images_of_its_tiles(tmp_path: Path) -> None:
    files = [tile(tmp_path / f"{k}.glb", 2 * k, [material("wall")]) for k in range(2)]
    umbel.build_asset(files, tmp_path / "out.umbel")
    (wall,) = umbel.Asset(tmp_path / "out.umbel").materials
    assert wall.images["base_color"].encoded() == PNG
