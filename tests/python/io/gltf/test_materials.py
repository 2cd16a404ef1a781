"""Materials as glTF files have them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from helpers.gltf_builder import INDICES, GltfBuilder, one, read
from helpers.gltf_files import json_of
from helpers.mesh_files import (
    TETRA_POSITIONS,
    TETRA_TRIANGLES,
)
from umbel import Asset, Material, Mesh, build_lod
from umbel.errors import LoadWarning
from umbel.io import load, save
from umbel.io.gltf.materials import read_material, write_material


def test_materials_are_read(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["images"] = [{"uri": "bark.png"}]
    b.root["textures"] = [{"source": 0}]
    b.root["materials"] = [
        {
            "name": "bark",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
                "metallicFactor": 0.5,
                "roughnessFactor": 0.6,
                "baseColorTexture": {"index": 0, "texCoord": 1},
            },
            "emissiveFactor": [1, 0, 0.5],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
            "doubleSided": True,
            "alphaMode": "MASK",
            "alphaCutoff": 0.25,
        },
        {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"glossinessFactor": 0.25}}},
    ]
    one(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0), builder=b)
    mesh = read(tmp_path, b)
    bark, glossy = mesh.materials
    assert bark.name == "bark"
    assert bark.base_color == (0.1, 0.2, 0.3, 0.4)
    assert (bark.metallic, bark.roughness) == (0.5, 0.6)
    assert bark.emissive == (4, 0, 2)
    assert (bark.double_sided, bark.alpha_mode, bark.alpha_cutoff) == (True, "MASK", 0.25)
    assert bark.images["base_color"].path == tmp_path / "bark.png"
    assert bark.textures["base_color"]["texCoord"] == 1
    assert (glossy.metallic, glossy.roughness) == (0.0, 0.75)
    assert mesh.material_ids.tolist() == [0, 0, 0, 0]


def test_extensions_of_materials_are_kept_with_their_textures(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["images"] = [{"uri": "coat.png"}]
    b.root["textures"] = [{"source": 0}]
    coat = {"clearcoatFactor": 0.5, "clearcoatTexture": {"index": 0, "texCoord": 1}}
    b.root["materials"] = [
        {"extensions": {"KHR_materials_clearcoat": coat, "ACME_x": {"a": [1]}}, "extras": {"id": 7}}
    ]
    one(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0), builder=b)
    (material,) = read(tmp_path, b).materials
    kept = {"clearcoatFactor": 0.5, "clearcoatTexture": {"texCoord": 1}}
    assert material.extensions == {"KHR_materials_clearcoat": kept, "ACME_x": {"a": [1]}}
    assert material.extras == {"id": 7}
    assert set(material.textures) == set(material.images)
    info = material.textures["KHR_materials_clearcoat/clearcoatTexture"]
    assert info == {"texCoord": 1}
    assert material.images["KHR_materials_clearcoat/clearcoatTexture"].path == tmp_path / "coat.png"


def test_textures_of_unknown_extensions_are_found_by_their_indices(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["images"] = [{"uri": f"{k}.png"} for k in range(4)]
    b.root["textures"] = [{"source": k} for k in range(4)]
    layers = {
        "layers": [{"map": {"index": 1}}, {"index": 2, "x": 5}, {"map": {"index": 7}}],
        "values": {"u_paint": {"index": 1}},
    }
    b.root["materials"] = [
        {
            "extensions": {"ACME_layers": layers, "MOZ_lightmap": {"index": 0, "intensity": 2}},
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 3}},
        }
    ]
    primitive = b.primitive(
        {"POSITION": TETRA_POSITIONS, "TEXCOORD_0": TETRA_POSITIONS[:, :2].copy()}, INDICES
    )
    one({**primitive, "material": 0}, builder=b)
    for k in range(4):
        Image.new("RGB", (1, 1), (k, 0, 0)).save(tmp_path / f"{k}.png")
    with pytest.warns(LoadWarning, match="a texture without an image"):
        mesh = read(tmp_path, b)
    save(tmp_path / "out.glb", mesh)
    build_lod(mesh).save(tmp_path / "out.umbel")
    for material in (
        *mesh.materials,
        *load(tmp_path / "out.glb").materials,
        *Asset(tmp_path / "out.umbel").materials,
    ):
        reds = {slot: int(image.texels()[0, 0, 0]) for slot, image in material.images.items()}
        assert reds == {
            "base_color": 3,
            "MOZ_lightmap": 0,
            "ACME_layers/layers/0/map": 1,
            "ACME_layers/layers/1": 2,
            "ACME_layers/values/u_paint": 1,
        }
    written = json_of(tmp_path / "out.glb")["materials"][0]["extensions"]
    numbers = [
        written["ACME_layers"]["layers"][0]["map"]["index"],
        written["MOZ_lightmap"]["index"],
    ]
    assert len({*numbers, written["ACME_layers"]["layers"][1]["index"]}) == 3
    assert written["ACME_layers"]["layers"][1]["x"] == 5
    assert written["ACME_layers"]["layers"][2] == {}
    assert written["ACME_layers"]["values"]["u_paint"]["index"] == numbers[0]


@pytest.mark.parametrize(
    ("factors", "changes"),
    [
        ({"base_color": (255, 0, 0, 1)}, True),
        ({"roughness": -0.5}, True),
        ({"emissive": (-1, 0, 0)}, True),
        ({"emissive": (9, 0, 0), "base_color": (1.0000001, 0, 0, 1)}, False),
    ],
)
def test_factors_that_gltf_forbids_are_changed_with_a_warning(
    tmp_path: Path, factors: dict[str, Any], changes: bool
) -> None:
    mesh = Mesh(
        TETRA_POSITIONS,
        TETRA_TRIANGLES,
        material_ids=np.zeros(4, np.uint32),
        materials=[Material("m", **factors)],
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        save(tmp_path / "a.glb", mesh)
        build_lod(mesh).save(tmp_path / "a.umbel")
    says = "written without: factors of materials outside 0 to 1, which become 0 or 1"
    assert [str(w.message).endswith(says) for w in caught] == [True, True] * changes


def test_extras_of_the_strength_of_emission_are_kept(tmp_path: Path) -> None:
    for strength in (0.5, 4.0):
        b = GltfBuilder()
        said = {"emissiveStrength": strength, "extras": {"unit": "nits"}}
        b.root["materials"] = [
            {"emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": said}}
        ]
        one(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0), builder=b)
        [material] = read(tmp_path, b).materials
        assert material.emissive == (strength,) * 3
        again = read_material(write_material(material), lambda _: None)
        assert again.emissive == material.emissive
        kept = write_material(again)["extensions"]["KHR_materials_emissive_strength"]
        assert kept == (said if strength > 1 else {"extras": said["extras"]})
