"""Materials with all that glTF says of them: from a file into an asset and back."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.gltf_builder import GltfBuilder
from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES
from umbel.io.textures.images import TextureImage
from umbel.lod.materials import read_materials, write_materials

INDICES = TETRA_TRIANGLES.reshape(-1)


def picture(kind: str = "PNG", color: tuple[int, int, int] = (255, 0, 0)) -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (4, 4), color).save(out, kind)
    return out.getvalue()


def rich() -> GltfBuilder:
    """A tetrahedron whose material uses what there is."""
    b = GltfBuilder()

    def image(data: bytes, mime: str, name: str) -> dict[str, Any]:
        view = b.view(data)
        return {"bufferView": view, "mimeType": mime, "name": name}

    b.root["images"] = [
        image(picture(), "image/png", "red"),
        image(picture("WEBP", (0, 255, 0)), "image/webp", "green"),
        image(picture("JPEG", (0, 0, 255)), "image/jpeg", "blue"),
        image(b"\xabKTX 20\xbb\r\n\x1a\nrest", "image/ktx2", "packed"),
    ]
    b.root["samplers"] = [
        {"magFilter": 9728, "minFilter": 9985, "wrapS": 33071, "wrapT": 33648, "name": "crisp"}
    ]
    b.root["textures"] = [
        {"source": 0, "sampler": 0, "name": "bark", "extras": {"by": "me"}},
        {"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}},
        {"source": 2},
        {"extensions": {"KHR_texture_basisu": {"source": 3}}},
    ]
    moved = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1.5, "texCoord": 1}}
    b.root["materials"] = [
        {
            "name": "all",
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": 0, "extensions": moved},
                "metallicRoughnessTexture": {"index": 3},
            },
            "normalTexture": {"index": 1, "scale": 0.5},
            "occlusionTexture": {"index": 2, "strength": 0.25, "texCoord": 1},
            "extensions": {
                "KHR_materials_clearcoat": {
                    "clearcoatFactor": 0.75,
                    "clearcoatNormalTexture": {"index": 1, "scale": 2, "extensions": moved},
                },
                "KHR_materials_ior": {"ior": 1.4},
                "EXT_of_somebody": {
                    "deep": {"odd_Texture": {"index": 2}},
                    "list": [1, {"a": None}],
                },
                "KHR_materials_emissive_strength": {"emissiveStrength": 3},
            },
            "emissiveFactor": [1, 0.5, 0],
            "extras": {"kept": [1, 2, "three"]},
        },
        {"name": "plain", "extensions": {"KHR_materials_unlit": {}}},
    ]
    uvs = np.zeros((4, 2), np.float32)
    attributes = {"POSITION": TETRA_POSITIONS, "TEXCOORD_0": uvs, "TEXCOORD_1": uvs}
    b.scene(b.node(mesh=b.mesh(b.primitive(attributes, INDICES, material=0))))
    return b


@pytest.fixture
def materials(tmp_path: Path) -> list[umbel.Material]:
    path = tmp_path / "rich.glb"
    path.write_bytes(rich().glb())
    return umbel.load(path).materials


def test_everything_is_read(materials: list[umbel.Material]) -> None:
    one, plain = materials
    assert sorted(one.images) == [
        "EXT_of_somebody/deep/odd_Texture",
        "KHR_materials_clearcoat/clearcoatNormalTexture",
        "base_color",
        "metallic_roughness",
        "normal",
        "occlusion",
    ]
    assert one.emissive == (3.0, 1.5, 0.0)
    assert one.extras == {"kept": [1, 2, "three"]}
    assert one.extensions["KHR_materials_ior"] == {"ior": 1.4}
    assert "KHR_materials_emissive_strength" not in one.extensions
    coat = one.extensions["KHR_materials_clearcoat"]
    assert coat["clearcoatFactor"] == 0.75
    assert coat["clearcoatNormalTexture"]["scale"] == 2
    assert one.textures["occlusion"] == {"strength": 0.25, "texCoord": 1}
    bark = one.images["base_color"]
    assert (bark.wrap_u, bark.wrap_v, bark.nearest) == ("clamp", "mirror", True)
    assert bark.gltf["sampler"]["minFilter"] == 9985
    assert bark.gltf["texture"] == {"name": "bark", "extras": {"by": "me"}}
    green = one.images["normal"]
    assert green.extension == "EXT_texture_webp" and green.fallback is not None
    assert green.texels()[0, 0, 1] > 250 and green.fallback.texels()[0, 0, 0] > 250
    assert plain.extensions == {"KHR_materials_unlit": {}}


def test_everything_comes_back_from_an_asset(materials: list[umbel.Material]) -> None:
    text, files = write_materials(materials, "embed", Path())
    assert read_materials(text, files.__getitem__, None) == materials
    root = json.loads(text)
    assert root["extensionsUsed"] == [
        "EXT_of_somebody",
        "EXT_texture_webp",
        "KHR_materials_clearcoat",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_unlit",
        "KHR_texture_basisu",
        "KHR_texture_transform",
    ]
    assert root["extensionsRequired"] == ["KHR_texture_basisu"]
    assert {"name": "crisp", **root["samplers"][0]} == root["samplers"][0]
    assert picture() in files and picture("WEBP", (0, 255, 0)) in files


def test_materials_with_other_images_are_others(materials: list[umbel.Material]) -> None:
    one = umbel.Material(images={"base_color": TextureImage(picture())})
    same = umbel.Material(images={"base_color": TextureImage(picture())})
    other = umbel.Material(images={"base_color": TextureImage(picture("JPEG"))})
    assert one == same
    assert one != other
    assert materials[0] != materials[1]


def test_images_that_are_not_there_are_one_warning(tmp_path: Path) -> None:
    gone = {slot: TextureImage(path=tmp_path / f"{slot}.png") for slot in ("base_color", "normal")}
    with pytest.warns(umbel.LoadWarning, match=r"base_color\.png.*; .*normal\.png") as said:
        text, files = write_materials([umbel.Material(images=gone)], "embed", tmp_path)
    assert len(said) == 1
    assert not files and "Texture" not in text


def test_without_textures_the_rest_stays(materials: list[umbel.Material]) -> None:
    text, files = write_materials(materials, "none", Path())
    again, _ = read_materials(text, files.__getitem__, None)
    assert not files and not again.images
    assert again.extensions["KHR_materials_clearcoat"] == {"clearcoatFactor": 0.75}
    assert again.extras == materials[0].extras


def test_images_outside_of_the_assets_folder_are_embedded(tmp_path: Path) -> None:
    folder = tmp_path / "asset"
    folder.mkdir()
    for path in (folder / "inside.png", tmp_path / "above.png"):
        path.write_bytes(picture())
    images = {
        "base_color": TextureImage(path=folder / "inside.png"),
        "emissive": TextureImage(path=tmp_path / "above.png"),
    }
    text, files = write_materials([umbel.Material(images=images)], "external", folder)
    assert files == [picture()]
    (again,) = read_materials(text, lambda k: files[k], folder)
    assert again.images["base_color"].path == folder / "inside.png"
    assert again.images["emissive"].encoded() == picture()


@pytest.mark.parametrize("raw", [b"12:30.png", b"a\\b.png", b"caf\xe9.png", b"a%20#?.png"])
def test_images_of_any_name_are_found_again(tmp_path: Path, raw: bytes) -> None:
    path = tmp_path / os.fsdecode(raw)
    path.write_bytes(picture())
    given = umbel.Material(images={"base_color": TextureImage(path=path)})
    text, files = write_materials([given], "external", tmp_path)
    (again,) = read_materials(text, lambda k: files[k], tmp_path)
    assert again.images["base_color"].encoded() == picture()
    assert len(files) == (raw != b"a%20#?.png")  # which readers look for beside the asset


def test_a_material_whose_name_is_no_text_is_a_warning(tmp_path: Path) -> None:
    mesh = umbel.shapes.blob(1, seed=1)
    mesh.materials = [umbel.Material(name="a\ud800b")]
    mesh.material_ids = np.zeros(len(mesh.triangles), np.uint32)
    with pytest.warns(umbel.LoadWarning, match=r"no text become: 'a\?b'"):
        umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    with pytest.warns(umbel.LoadWarning, match=r"no text become: 'a\?b'"):
        umbel.save(tmp_path / "a.glb", mesh)
    assert umbel.Asset(tmp_path / "a.umbel").materials[0].name == "a?b"
