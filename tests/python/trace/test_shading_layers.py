"""glTF's extensions of materials: what reaches the path tracer, and what is said of the rest."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.pictures import DARK, EVEN, emitting, names, seen, write_square
from umbel.trace.shading import Shading

GREY = {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1], "metallicFactor": 0}}
TEXTURE = {"index": 0}


def shading_of(tmp_path: Path, extensions: dict[str, Any], **more: Any) -> Shading:
    material = GREY | {"extensions": extensions} | more
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return Shading(umbel.load(write_square(tmp_path / "a.gltf", material)))


#: Of each extension: its JSON, and what the tracer's material then has.
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "KHR_materials_ior": ({"ior": 1.4}, {"ior": 1.4}),
    "KHR_materials_specular": (
        {"specularFactor": 0.5, "specularColorFactor": [1, 2, 0], "specularTexture": TEXTURE},
        {"specular": 0.5, "specular_color": (1, 2, 0), "specular_texture": 0},
    ),
    "KHR_materials_transmission": (
        {"transmissionFactor": 0.75, "transmissionTexture": TEXTURE},
        {"transmission": 0.75, "body": False, "transmission_texture": 0},
    ),
    "KHR_materials_volume": (
        {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]},
        {"body": True, "attenuation_distance": 2, "attenuation_color": (1, 0.5, 0)},
    ),
    "KHR_materials_diffuse_transmission": (
        {"diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [0, 1, 0]},
        {"diffuse_transmission": 0.5, "diffuse_transmission_color": (0, 1, 0)},
    ),
    "KHR_materials_clearcoat": (
        {
            "clearcoatFactor": 0.5,
            "clearcoatRoughnessFactor": 0.25,
            "clearcoatTexture": TEXTURE,
            "clearcoatNormalTexture": {"index": 0, "scale": 0.5},
        },
        {
            "clearcoat": 0.5,
            "clearcoat_roughness": 0.25,
            "clearcoat_texture": 0,
            "clearcoat_roughness_texture": -1,
            "clearcoat_normal_texture": 0,
            "clearcoat_normal_scale": 0.5,
        },
    ),
    "KHR_materials_sheen": (
        {"sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": 0.5},
        {"sheen_color": (1, 0.5, 0), "sheen_roughness": 0.5},
    ),
    "KHR_materials_iridescence": (
        {"iridescenceFactor": 1, "iridescenceIor": 1.5, "iridescenceThicknessMaximum": 500},
        {"iridescence": 1, "iridescence_ior": 1.5, "iridescence_thickness_min": 100},
    ),
    "KHR_materials_unlit": ({}, {"unlit": True}),
    "KHR_materials_pbrSpecularGlossiness": (
        {"specularFactor": [0.04, 0.08, 0]},
        {"specular_color": (1, 2, 0)},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_an_extension_reaches_the_tracer(tmp_path: Path, name: str) -> None:
    given, expected = CASES[name]
    (material,) = shading_of(tmp_path, {name: given}).materials
    for key, value in expected.items():
        found = getattr(material, key)
        assert (found[0] if key.endswith("texture") else found) == pytest.approx(value), key


@pytest.mark.parametrize("name", CASES)
def test_values_of_the_wrong_kind_are_as_if_absent(tmp_path: Path, name: str) -> None:
    given, _ = CASES[name]
    wrong = {key: "much" for key in given if not key.endswith("Texture")}
    (material,) = shading_of(tmp_path, {name: wrong}).materials
    (plain,) = shading_of(tmp_path, {name: {}}).materials
    for key in CASES[name][1]:
        assert getattr(material, key) == getattr(plain, key)


@pytest.mark.parametrize(
    "info",
    [
        {"scale": "much"},
        {"scale": None},
        {"extensions": [1]},
        {"extensions": {"KHR_texture_transform": [1]}},
    ],
)
def test_textures_with_values_of_the_wrong_kind_are_as_if_without(
    tmp_path: Path, info: dict[str, Any]
) -> None:
    coat = "KHR_materials_clearcoat"
    (material,), (plain,) = (
        shading_of(tmp_path, {coat: {"clearcoatNormalTexture": TEXTURE | more}}).materials
        for more in (info, {})
    )
    for key in ("clearcoat_normal_texture", "clearcoat_normal_scale"):
        assert getattr(material, key) == getattr(plain, key)


def test_extensions_that_are_not_rendered_are_one_warning_each(tmp_path: Path) -> None:
    material = GREY | {"name": "steel", "extensions": {"KHR_materials_anisotropy": {}}}
    path = write_square(tmp_path / "a.gltf", material, materials=[material, material])
    with pytest.warns(umbel.LoadWarning) as said:
        Shading(umbel.load(path))
    (sentence,) = (str(one.message) for one in said)
    assert "KHR_materials_anisotropy" in sentence and "steel" in sentence and "2" in sentence


def test_what_is_unlit_shows_its_base_colour_and_no_emission(tmp_path: Path) -> None:
    material = GREY | {"emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_unlit": {}}}
    path = write_square(tmp_path / "a.gltf", material)
    for light in (DARK, EVEN):
        assert seen(path, light)[8, 8] == pytest.approx((0.2, 0.4, 0.6), abs=1e-4)


def test_glass_lets_light_through_and_a_coat_adds_a_reflection(tmp_path: Path) -> None:
    def brightness(extensions: dict[str, Any], **pbr: Any) -> float:
        material = {"pbrMetallicRoughness": {"metallicFactor": 0, **pbr}, "extensions": extensions}
        path = write_square(tmp_path / "a.gltf", material)
        return float(seen(path, EVEN, samples=256, max_bounces=4)[4:12, 4:12].mean())

    black = {"baseColorFactor": [0, 0, 0, 1], "roughnessFactor": 1}
    half = {"baseColorFactor": [0.5, 0.5, 0.5, 1], "roughnessFactor": 0}
    coat = {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}
    assert brightness(coat, **black) - brightness({}, **black) == pytest.approx(0.04, abs=0.01)
    pane = {"KHR_materials_transmission": {"transmissionFactor": 1}}
    assert brightness(pane, **half) == pytest.approx(0.04 + 0.96 * 0.5, abs=0.02)


def test_textures_use_the_texture_coordinates_that_they_name(tmp_path: Path) -> None:
    path = write_square(tmp_path / "a.gltf", emitting(texCoord=1), sampler={"magFilter": 9728})
    mesh = umbel.load(path)
    with pytest.warns(umbel.LoadWarning, match="texture coordinates"):
        Shading(mesh)
    assert mesh.uvs is not None
    mesh.uv_sets = [mesh.uvs[:, ::-1].copy()]
    mesh.uvs = np.zeros_like(mesh.uvs)
    assert names(seen(mesh)) == "rbgw"
    assert names(seen(mesh, ground=True)) == "rbgw"


def test_the_textured_scenes_are_shown_whole(data: Path) -> None:
    files = sorted((data / "textured").glob("*.glb"))
    if not files:
        pytest.skip("no textured scenes")
    for path in files:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", umbel.LoadWarning)  # of what is no material's
            mesh = umbel.load(path)
            warnings.simplefilter("error")
            assert Shading(mesh).materials
