"""Materials of glTF, to and from JSON."""

from __future__ import annotations

from typing import Any

from umbel.mesh import Material

Json = dict[str, Any]


def read_material(entry: Json, root: Json) -> Material:
    """A material; textures stay as the JSON has them, with the image's entry added."""
    pbr = entry.get("pbrMetallicRoughness") or {}
    extensions = entry.get("extensions") or {}
    strength = (extensions.get("KHR_materials_emissive_strength") or {}).get("emissiveStrength", 1)
    emissive = _color(entry.get("emissiveFactor"), (0.0, 0.0, 0.0))
    material = Material(
        name=str(entry.get("name", "")),
        base_color=_color(pbr.get("baseColorFactor"), (1.0, 1.0, 1.0, 1.0)),
        metallic=float(pbr.get("metallicFactor", 1.0)),
        roughness=float(pbr.get("roughnessFactor", 1.0)),
        emissive=tuple(v * float(strength) for v in emissive),
        double_sided=bool(entry.get("doubleSided", False)),
        alpha_mode=str(entry.get("alphaMode", "OPAQUE")),
        alpha_cutoff=float(entry.get("alphaCutoff", 0.5)),
        extensions=without_indices(extensions),
        extras=entry.get("extras"),
    )
    slots = {
        "base_color": pbr.get("baseColorTexture"),
        "metallic_roughness": pbr.get("metallicRoughnessTexture"),
        "normal": entry.get("normalTexture"),
        "occlusion": entry.get("occlusionTexture"),
        "emissive": entry.get("emissiveTexture"),
        **extension_textures(extensions),
    }
    glossy = extensions.get("KHR_materials_pbrSpecularGlossiness")
    if glossy and not pbr:
        material.base_color = _color(glossy.get("diffuseFactor"), (1.0, 1.0, 1.0, 1.0))
        material.metallic = 0.0
        material.roughness = 1.0 - float(glossy.get("glossinessFactor", 1.0))
        slots["base_color"] = glossy.get("diffuseTexture")
    material.textures = {
        slot: {**info, "image": _image(info, root)} for slot, info in slots.items() if info
    }
    return material


def extension_textures(extensions: Json) -> dict[str, Json]:
    """The texture infos that a material's extensions have, by the names of their slots."""
    return {
        f"{name}/{key}": info
        for name, extension in extensions.items()
        if isinstance(extension, dict)
        for key, info in extension.items()
        if _is_texture(key, info)
    }


def without_indices(extensions: Json) -> Json:
    """The same JSON whose texture infos do not say which texture: that is the slot's image."""
    return {
        name: {
            key: {k: v for k, v in info.items() if k != "index"} if _is_texture(key, info) else info
            for key, info in extension.items()
        }
        if isinstance(extension, dict)
        else extension
        for name, extension in extensions.items()
    }


def _is_texture(key: str, info: Any) -> bool:
    return key.endswith("Texture") and isinstance(info, dict) and isinstance(info.get("index"), int)


def write_material(material: Material) -> Json:
    """The material as JSON, without its textures."""
    entry: Json = {
        "pbrMetallicRoughness": {
            "baseColorFactor": list(material.base_color),
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        }
    }
    if material.name:
        entry["name"] = material.name
    strength = max(1.0, *material.emissive)
    if any(material.emissive):
        entry["emissiveFactor"] = [v / strength for v in material.emissive]
    if strength > 1.0:
        entry["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    if material.double_sided:
        entry["doubleSided"] = True
    if material.alpha_mode != "OPAQUE":
        entry["alphaMode"] = material.alpha_mode
    if material.alpha_mode == "MASK":
        entry["alphaCutoff"] = material.alpha_cutoff
    return entry


def _color(values: Any, default: Any) -> Any:
    if not isinstance(values, list) or len(values) != len(default):
        return default
    return tuple(float(v) for v in values)


def _image(info: Json, root: Json) -> Json | None:
    """The image that a texture reference ends at, if the file has it."""
    try:
        texture = root["textures"][info["index"]]
        source = texture.get("source")
        for extension in (texture.get("extensions") or {}).values():
            source = extension.get("source", source)
        image = root["images"][source]
    except (KeyError, IndexError, TypeError, AttributeError):
        return None
    return image if isinstance(image, dict) else None
