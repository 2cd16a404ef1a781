"""glTF's extensions of materials as the path tracer takes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
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

#: Extensions that do not change the picture.
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
        scale = info.get("scale", 1.0) if isinstance(info, dict) else 1.0
        return float(scale) if isinstance(scale, (int, float)) else 1.0


@dataclass(frozen=True)
class _Layer:
    """How one extension becomes fields of the tracer's material: (field, key in the JSON), with the
    default and the range of numbers, and the default and the largest value of colours."""

    numbers: Sequence[tuple[str, str, float, float, float]] = ()
    colors: Sequence[tuple[str, str, float, float]] = ()
    textures: Sequence[tuple[str, str]] = ()
    more: Callable[[_Extension, _umbel.TraceMaterial], None] | None = None
    """What the table cannot say."""

    def add(self, extension: _Extension, out: _umbel.TraceMaterial) -> None:
        for field, key, default, low, high in self.numbers:
            setattr(out, field, extension.number(key, default, low, high))
        for field, key, gray, most in self.colors:
            setattr(out, field, extension.color(key, gray, most))
        for field, key in self.textures:
            setattr(out, field, extension.texture(key))
        if self.more is not None:
            self.more(extension, out)


def _clamp_ior(_: _Extension, out: _umbel.TraceMaterial) -> None:
    """Below 1 only 0 means something: that the extension does not apply."""
    if 0.0 < out.ior < 1.0:
        out.ior = 1.0


def _has_volume(extension: _Extension, out: _umbel.TraceMaterial) -> None:
    """Rays find out themselves how thick it is."""
    out.body = extension.number("thicknessFactor", 0.0, 0.0, math.inf) > 0.0


def _clearcoat_scale(extension: _Extension, out: _umbel.TraceMaterial) -> None:
    out.clearcoat_normal_scale = extension.scale("clearcoatNormalTexture")


def _glossy_color(extension: _Extension, out: _umbel.TraceMaterial) -> None:
    """The colour of the reflection; roughness is the material's own, from the glossiness."""
    r, g, b = (v / _DIELECTRIC for v in extension.color("specularFactor", 1.0))
    out.specular_color = (r, g, b)


_RENDERED = {
    "KHR_materials_ior": _Layer(
        numbers=[("ior", "ior", 1.5, 0.0, 100.0)],
        more=_clamp_ior,
    ),
    "KHR_materials_specular": _Layer(
        numbers=[("specular", "specularFactor", 1.0, 0.0, 1.0)],
        colors=[("specular_color", "specularColorFactor", 1.0, 100.0)],
        textures=[
            ("specular_texture", "specularTexture"),
            ("specular_color_texture", "specularColorTexture"),
        ],
    ),
    "KHR_materials_transmission": _Layer(
        numbers=[("transmission", "transmissionFactor", 0.0, 0.0, 1.0)],
        textures=[("transmission_texture", "transmissionTexture")],
    ),
    "KHR_materials_volume": _Layer(
        numbers=[("attenuation_distance", "attenuationDistance", math.inf, 1e-30, math.inf)],
        colors=[("attenuation_color", "attenuationColor", 1.0, 1.0)],
        more=_has_volume,
    ),
    "KHR_materials_diffuse_transmission": _Layer(
        numbers=[("diffuse_transmission", "diffuseTransmissionFactor", 0.0, 0.0, 1.0)],
        colors=[("diffuse_transmission_color", "diffuseTransmissionColorFactor", 1.0, 1.0)],
        textures=[
            ("diffuse_transmission_texture", "diffuseTransmissionTexture"),
            ("diffuse_transmission_color_texture", "diffuseTransmissionColorTexture"),
        ],
    ),
    "KHR_materials_clearcoat": _Layer(
        numbers=[
            ("clearcoat", "clearcoatFactor", 0.0, 0.0, 1.0),
            ("clearcoat_roughness", "clearcoatRoughnessFactor", 0.0, 0.0, 1.0),
        ],
        textures=[
            ("clearcoat_texture", "clearcoatTexture"),
            ("clearcoat_roughness_texture", "clearcoatRoughnessTexture"),
            ("clearcoat_normal_texture", "clearcoatNormalTexture"),
        ],
        more=_clearcoat_scale,
    ),
    "KHR_materials_sheen": _Layer(
        numbers=[("sheen_roughness", "sheenRoughnessFactor", 0.0, 0.0, 1.0)],
        colors=[("sheen_color", "sheenColorFactor", 0.0, 1.0)],
        textures=[
            ("sheen_color_texture", "sheenColorTexture"),
            ("sheen_roughness_texture", "sheenRoughnessTexture"),
        ],
    ),
    "KHR_materials_iridescence": _Layer(
        numbers=[
            ("iridescence", "iridescenceFactor", 0.0, 0.0, 1.0),
            ("iridescence_ior", "iridescenceIor", 1.3, 1.0, 100.0),
            ("iridescence_thickness_min", "iridescenceThicknessMinimum", 100.0, 0.0, 1e6),
            ("iridescence_thickness_max", "iridescenceThicknessMaximum", 400.0, 0.0, 1e6),
        ],
        textures=[
            ("iridescence_texture", "iridescenceTexture"),
            ("iridescence_thickness_texture", "iridescenceThicknessTexture"),
        ],
    ),
    _GLOSSY: _Layer(
        textures=[("specular_color_texture", "specularGlossinessTexture")],
        more=_glossy_color,
    ),
}


def is_unlit(material: Material) -> bool:
    """Whether it shows its base colour unlit."""
    return _UNLIT in material.extensions


def add_layers(
    material: Material, out: _umbel.TraceMaterial, textures: Callable[[str], Use]
) -> None:
    """What a material's extensions say; `textures` gives the use of a slot."""
    if is_unlit(material):
        out.unlit = True
        out.emission, out.emission_texture = (0.0, 0.0, 0.0), NO_TEXTURE
        return
    for name, layer in _RENDERED.items():
        if name in material.extensions:
            layer.add(_Extension(name, material, textures), out)


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
