"""Materials as glTF files have them."""

from __future__ import annotations

from pathlib import Path

from helpers.gltf_builder import INDICES, GltfBuilder, one, read
from helpers.mesh_files import (
    TETRA_POSITIONS,
)


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
