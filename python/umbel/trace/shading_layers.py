"""glTF's extensions of materials as the path tracer takes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from umbel import _umbel
from umbel.geometry.mesh import Material

Use = tuple[int, float, float, float, float, float, int]
NO_TEXTURE: Use = (-1, 0.0, 0.0, 1.0, 1.0, 0.0, 0)

#: Textures in extensions whose colours are sRGB-encoded.
SRGB_TEXTURES = (
    "specularColorTexture", "sheenColorTexture", "diffuseTransmissionColorTexture",
    "specularGlossinessTexture",
)  # fmt: skip

#: Says nothing of how a surface looks.
_INVISIBLE = ("KHR_xmp_json_ld", "KHR_animation_pointer", "KHR_materials_emissive_strength")
_UNLIT = "KHR_materials_unlit"
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"
_DIELECTRIC = 0.04  # reflectance at normal incidence of what has the index 1.5


class _Extension:
    """The JSON of one extension: its numbers within their ranges, and its textures."""

    def __init__(self, name: str, material: Material, textures: Callable[[str], Use]) -> None:
        self.name, self.textures = name, textures
        given = material.extensions.get(name)
        self.json: dict[str, Any] = given if isinstance(given, dict) else {}

    def number(self, key: str, default: float, low: float = 0.0, high: float = 1.0) -> float:
        value = self.json.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or math.isnan(value):
            return default
        return float(np.clip(value, low, high))

    def color(self, key: str, default: float, high: float = 1.0) -> tuple[float, float, float]:
        value = self.json.get(key)
        try:
            r, g, b = (float(np.clip(v, 0.0, high)) for v in value or ())
        except (TypeError, ValueError):
            return default, default, default
        return r, g, b

    def texture(self, key: str) -> Use:
        return self.textures(f"{self.name}/{key}") if key in self.json else NO_TEXTURE

    def scale(self, key: str) -> float:
        info = self.json.get(key)
        return float(info.get("scale", 1.0)) if isinstance(info, dict) else 1.0


def _ior(e: _Extension, out: _umbel.TraceMaterial) -> None:
    out.ior = e.number("ior", 1.5, 0.0, 100.0)
    if 0.0 < out.ior < 1.0:
        out.ior = 1.0


def _specular(e: _Extension, out: _umbel.TraceMaterial) -> None:
    out.specular = e.number("specularFactor", 1.0)
    out.specular_color = e.color("specularColorFactor", 1.0, 100.0)
    out.specular_texture = e.texture("specularTexture")
    out.specular_color_texture = e.texture("specularColorTexture")


def _transmission(e: _Extension, out: _umbel.TraceMaterial) -> None:
    out.transmission = e.number("transmissionFactor", 0.0)
    out.transmission_texture = e.texture("transmissionTexture")


def _volume(e: _Extension, out: _umbel.TraceMaterial) -> None:
    """How thick it is, rays find out themselves."""
    out.body = e.number("thicknessFactor", 0.0, 0.0, math.inf) > 0.0
    out.attenuation_distance = e.number("attenuationDistance", math.inf, 1e-30, math.inf)
    out.attenuation_color = e.color("attenuationColor", 1.0)


def _diffuse_transmission(e: _Extension, out: _umbel.TraceMaterial) -> None:
    out.diffuse_transmission = e.number("diffuseTransmissionFactor", 0.0)
    out.diffuse_transmission_color = e.color("diffuseTransmissionColorFactor", 1.0)
    out.diffuse_transmission_texture = e.texture("diffuseTransmissionTexture")
    out.diffuse_transmission_color_texture = e.texture("diffuseTransmissionColorTexture")


def _clearcoat(e: _Extension, out: _umbel.TraceMaterial) -> None:
    out.clearcoat = e.number("clearcoatFactor", 0.0)
    out.clearcoat_roughness = e.number("clearcoatRoughnessFactor", 0.0)
    out.clearcoat_normal_scale = e.scale("clearcoatNormalTexture")
    out.clearcoat_texture = e.texture("clearcoatTexture")
    out.clearcoat_roughness_texture = e.texture("clearcoatRoughnessTexture")
    out.clearcoat_normal_texture = e.texture("clearcoatNormalTexture")


def _sheen(e: _Extension, out: _umbel.TraceMaterial) -> None:
    out.sheen_color = e.color("sheenColorFactor", 0.0)
    out.sheen_roughness = e.number("sheenRoughnessFactor", 0.0)
    out.sheen_color_texture = e.texture("sheenColorTexture")
    out.sheen_roughness_texture = e.texture("sheenRoughnessTexture")


def _iridescence(e: _Extension, out: _umbel.TraceMaterial) -> None:
    out.iridescence = e.number("iridescenceFactor", 0.0)
    out.iridescence_ior = e.number("iridescenceIor", 1.3, 1.0, 100.0)
    out.iridescence_thickness_min = e.number("iridescenceThicknessMinimum", 100.0, 0.0, 1e6)
    out.iridescence_thickness_max = e.number("iridescenceThicknessMaximum", 400.0, 0.0, 1e6)
    out.iridescence_texture = e.texture("iridescenceTexture")
    out.iridescence_thickness_texture = e.texture("iridescenceThicknessTexture")


def _glossy(e: _Extension, out: _umbel.TraceMaterial) -> None:
    """The colour of the reflection; roughness is the material's own, from the glossiness."""
    r, g, b = (v / _DIELECTRIC for v in e.color("specularFactor", 1.0))
    out.specular_color = (r, g, b)
    out.specular_color_texture = e.texture("specularGlossinessTexture")


_RENDERED: dict[str, Callable[[_Extension, _umbel.TraceMaterial], None]] = {
    "KHR_materials_ior": _ior,
    "KHR_materials_specular": _specular,
    "KHR_materials_transmission": _transmission,
    "KHR_materials_volume": _volume,
    "KHR_materials_diffuse_transmission": _diffuse_transmission,
    "KHR_materials_clearcoat": _clearcoat,
    "KHR_materials_sheen": _sheen,
    "KHR_materials_iridescence": _iridescence,
    _GLOSSY: _glossy,
}


def is_unlit(material: Material) -> bool:
    """Whether it shows its base colour whatever the light."""
    return _UNLIT in material.extensions


def add_layers(
    material: Material, out: _umbel.TraceMaterial, textures: Callable[[str], Use]
) -> None:
    """What a material's extensions say; `textures` gives the use of a slot."""
    if is_unlit(material):
        out.unlit = True
        out.emission, out.emission_texture = (0.0, 0.0, 0.0), NO_TEXTURE
        return
    for name, add in _RENDERED.items():
        if name in material.extensions:
            add(_Extension(name, material, textures), out)


def not_rendered(materials: Sequence[Material]) -> list[str]:
    """A sentence for each extension that materials have and pictures do not show."""
    users: dict[str, list[str]] = {}
    for material in materials:
        for name, given in material.extensions.items():
            if name == _GLOSSY and "specularGlossinessTexture" in (given or {}):
                users.setdefault(f"the glossiness texture of {name}", []).append(material.name)
            if name not in _RENDERED and name not in (_UNLIT, *_INVISIBLE):
                users.setdefault(f"the extension {name}", []).append(material.name)
    return [f"{what} is not rendered; {_having(names)} it" for what, names in users.items()]


def _having(names: list[str]) -> str:
    if len(names) == 1:
        return f"material {names[0]!r} has"
    return f"{len(names)} materials, the first {names[0]!r}, have"
