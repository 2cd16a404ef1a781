"""Materials of glTF, to and from JSON."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Collection, Iterator
from typing import Any

import numpy as np

from umbel.errors import Error, warn_lost
from umbel.geometry.mesh import Material
from umbel.io.textures.images import TextureImage
from umbel.plain_json import plain

Json = dict[str, Any]

#: Where the core's textures are in the JSON of a material.
_SLOTS: dict[str, tuple[str, str]] = {
    "base_color": ("pbrMetallicRoughness", "baseColorTexture"),
    "metallic_roughness": ("pbrMetallicRoughness", "metallicRoughnessTexture"),
    "normal": ("", "normalTexture"),
    "occlusion": ("", "occlusionTexture"),
    "emissive": ("", "emissiveTexture"),
}
_STRENGTH = "KHR_materials_emissive_strength"
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"
ALPHA_MODES = ("OPAQUE", "MASK", "BLEND")
_NO_INFO = ("index", "image", "uri", "line")  #: what formats other than glTF say of a texture, too

Reference = Callable[[str, Json, TextureImage], "Json | None"]
"""Makes a textureInfo of (slot, what the material says of the texture, its image), or nothing."""


def read_material(entry: Json, image: Callable[[Any], TextureImage | None]) -> Material:
    """A material of a file; `image` gives that of the texture at an index, where there is one."""
    pbr = entry.get("pbrMetallicRoughness") or {}
    extensions = copy.deepcopy(entry.get("extensions") or {})
    strong = extensions.pop(_STRENGTH, None) or {}
    strength = strong.pop("emissiveStrength", 1)
    if strong:  # extras
        extensions[_STRENGTH] = strong
    emissive = _color(entry.get("emissiveFactor"), (0.0, 0.0, 0.0))
    mode = entry.get("alphaMode")
    material = Material(
        name=str(entry.get("name", "")),
        base_color=_color(pbr.get("baseColorFactor"), (1.0, 1.0, 1.0, 1.0)),
        metallic=float(pbr.get("metallicFactor", 1.0)),
        roughness=float(pbr.get("roughnessFactor", 1.0)),
        emissive=tuple(v * float(strength) for v in emissive),
        double_sided=bool(entry.get("doubleSided", False)),
        alpha_mode=mode if mode in ALPHA_MODES else "OPAQUE",
        alpha_cutoff=float(entry.get("alphaCutoff", 0.5)),
        extensions=extensions,
        extras=copy.deepcopy(entry.get("extras")),
    )
    given = {slot: (entry.get(a) or {} if a else entry).get(b) for slot, (a, b) in _SLOTS.items()}
    glossy = extensions.get(_GLOSSY)
    if glossy and not pbr:
        material.base_color = _color(glossy.get("diffuseFactor"), (1.0, 1.0, 1.0, 1.0))
        material.metallic = 0.0
        material.roughness = 1.0 - float(glossy.get("glossinessFactor", 1.0))
        given["base_color"] = glossy.get("diffuseTexture")
    found: dict[str, Json] = {s: dict(info) for s, info in given.items() if isinstance(info, dict)}
    found |= {slot: parent[key] for slot, parent, key in extension_textures(extensions)}
    for slot, info in found.items():
        made = image(info.pop("index", None))
        material.textures[slot] = info
        if made is not None:
            material.images[slot] = made
    return material


def extension_textures(
    extensions: Json, known: Collection[str] = ()
) -> Iterator[tuple[str, Any, Any]]:
    """Every textureInfo in a material's extensions: (slot, the object or array that it is in, its
    key there). They are the objects with an index, those whose name says so, and `known` slots."""
    stack: list[tuple[str, Any]] = [("", extensions)]
    while stack:
        path, holder = stack.pop()
        entries = holder.items() if isinstance(holder, dict) else enumerate(holder)
        inner: list[tuple[str, Any]] = []
        for key, value in list(entries):
            slot = f"{path}/{key}" if path else str(key)
            if isinstance(value, dict) and (
                type(value.get("index")) is int or str(key).endswith("Texture") or slot in known
            ):
                yield slot, holder, key
            elif isinstance(value, (dict, list)) and key not in ("extras", "extensions"):
                inner.append((slot, value))
        stack += reversed(inner)


def write_material(material: Material, reference: Reference | None = None) -> Json:
    """The material as JSON, with those of its textures that `reference` gives an info for. Raises
    for numbers that JSON cannot say."""
    entry: Json = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [_unit(v) for v in material.base_color],
            "metallicFactor": _unit(material.metallic),
            "roughnessFactor": _unit(material.roughness),
        }
    }
    if material.name:
        entry["name"] = named = plain(material.name)
        if named != material.name:
            warn_lost("names of materials that are no text become", [repr(named)])
    extensions = copy.deepcopy(material.extensions)
    emissive = [max(v, 0.0) for v in material.emissive]
    strength = max(1.0, *emissive)
    if any(emissive):
        entry["emissiveFactor"] = [v / strength for v in emissive]
    if strength > 1.0:
        extensions[_STRENGTH] = {**extensions.get(_STRENGTH, {}), "emissiveStrength": strength}
    if material.double_sided:
        entry["doubleSided"] = True
    if material.alpha_mode != "OPAQUE":
        entry["alphaMode"] = material.alpha_mode
    if material.alpha_mode == "MASK":
        entry["alphaCutoff"] = material.alpha_cutoff
    for slot, (section, key) in _SLOTS.items():
        info = _info(material, slot, {}, reference)
        if info is not None:
            (entry[section] if section else entry)[key] = info
    known = {*material.images, *material.textures}
    for slot, parent, key in list(extension_textures(extensions, known)):
        info = _info(material, slot, parent[key], reference)
        if info is not None or isinstance(parent, list):  # in which the others keep their places
            parent[key] = info or {}
        else:
            del parent[key]
    if extensions:
        entry["extensions"] = extensions
    wrong = next(_infinite(entry, ""), None)
    if wrong:
        raise Error(f"material {material.name!r} has {wrong}, which must be finite")
    if material.extras is not None:
        entry["extras"] = material.extras
    return entry


def _info(material: Material, slot: str, inside: Json, reference: Reference | None) -> Json | None:
    image = material.images.get(slot)
    if image is None or reference is None:
        return None
    given = {**inside, **material.textures.get(slot, {})}
    return reference(slot, {k: v for k, v in given.items() if k not in _NO_INFO}, image)


def texture_sets(entry: Any) -> int:
    """How many sets of UVs the textures of a material's JSON need."""
    most = 0
    for key, value in entry.items() if isinstance(entry, dict) else ():
        if isinstance(value, dict) and isinstance(value.get("index"), int):
            moved = (value.get("extensions") or {}).get("KHR_texture_transform") or {}
            uvs = moved.get("texCoord", value.get("texCoord"))
            most = max(most, 1 + (uvs if isinstance(uvs, int) else 0))
        elif key != "extras":
            most = max(most, texture_sets(value))
    return most


def extensions_in(value: Any) -> set[str]:
    """The names of all extensions anywhere in a part of glTF's JSON."""
    if isinstance(value, list):
        return set().union(*(extensions_in(item) for item in value))
    if not isinstance(value, dict):
        return set()
    used = value.get("extensions")
    names = set(used) if isinstance(used, dict) else set()
    return names.union(*(extensions_in(v) for k, v in value.items() if k != "extras"))


def _infinite(value: Any, place: str) -> Iterator[str]:
    """The numbers in a part of JSON that are NaN or infinite, by place and value."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key != "extras":
                yield from _infinite(item, f"{place}.{key}" if place else key)
    elif isinstance(value, (list, tuple)):
        for k, item in enumerate(value):
            yield from _infinite(item, f"{place}[{k}]")
    elif isinstance(value, (float, np.floating)) and not math.isfinite(value):
        yield f"{place} {value}"


#: What `write_material` does to values that glTF forbids, in words.
CLAMPED = "factors of materials outside 0 to 1, which become 0 or 1"
_ROUNDING = 1e-6


def is_clamped(material: Material) -> bool:
    """Whether `write_material` changes factors, by more than their rounding."""
    factors = (*material.base_color, material.metallic, material.roughness)
    return min(*factors, *material.emissive) < -_ROUNDING or max(factors) > 1 + _ROUNDING


def _unit(value: float) -> float:
    return min(max(float(value), 0.0), 1.0)


def _color(values: Any, default: Any) -> Any:
    if not isinstance(values, list) or len(values) != len(default):
        return default
    return tuple(float(v) for v in values)
