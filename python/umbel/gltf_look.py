"""Materials as an asset keeps them: glTF's own JSON, with images beside it as files."""

from __future__ import annotations

import json
import os
import urllib.parse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .errors import Error
from .io.files import read_bytes
from .io.gltf_materials import read_material, write_material
from .io.images import TextureImage, beside
from .mesh import Material
from .metadata import encode

Json = dict[str, Any]

_WRAPS = {"clamp": 33071, "mirror": 33648, "repeat": 10497}
_WRAP_NAMES = {number: name for name, number in _WRAPS.items()}
_NEAREST = 9728
_SLOTS = {
    "base_color": ("pbrMetallicRoughness", "baseColorTexture"),
    "metallic_roughness": ("pbrMetallicRoughness", "metallicRoughnessTexture"),
    "normal": (None, "normalTexture"),
    "occlusion": (None, "occlusionTexture"),
    "emissive": (None, "emissiveTexture"),
}
_FLIPPED = {"KHR_texture_transform": {"offset": [0, 1], "scale": [1, -1]}}


class _Writer:
    def __init__(self, textures: str, folder: Path) -> None:
        self.mode, self.folder = textures, folder
        self.root: dict[str, list[Any]] = {"images": [], "samplers": [], "textures": []}
        self.files: list[bytes] = []
        self.images: dict[Any, int] = {}

    def material(self, material: Material) -> Json:
        entry = write_material(material)
        for slot, image in material.images.items():
            if slot not in _SLOTS:
                continue
            source = self.image(image)
            if source is None:
                continue
            section, name = _SLOTS[slot]
            target = entry.setdefault(section, {}) if section else entry
            target[name] = self.info(material.textures.get(slot, {}), image, source)
        return entry

    def info(self, given: Json, image: TextureImage, source: int) -> Json:
        """A textureInfo: what the file said of it, at a texture of ours."""
        info = {key: value for key, value in given.items() if key not in ("index", "image")}
        if image.bottom_up:
            info["extensions"] = _FLIPPED
        sampler = {"wrapS": _WRAPS[image.wrap_u], "wrapT": _WRAPS[image.wrap_v]}
        if image.nearest:
            sampler["magFilter"] = _NEAREST
        texture = {"sampler": self.index("samplers", sampler), "source": source}
        return {**info, "index": self.index("textures", texture)}

    def index(self, table: str, entry: Json) -> int:
        if entry not in self.root[table]:
            self.root[table].append(entry)
        return self.root[table].index(entry)

    def image(self, image: TextureImage) -> int | None:
        """Its index; None where it cannot be read or has no place outside."""
        key = image.path if image.data is None else id(image.data)
        if key not in self.images:
            entry = self.outside(image) if self.mode == "external" else self.embedded(image)
            if entry is None:
                return None
            self.images[key] = self.index("images", entry)
        return self.images[key]

    def outside(self, image: TextureImage) -> Json | None:
        if image.path is None:
            return self.embedded(image)
        relative = os.path.relpath(image.path, self.folder).replace(os.sep, "/")
        return {"uri": urllib.parse.quote(relative)}

    def embedded(self, image: TextureImage) -> Json | None:
        data = image.data
        if data is None:
            try:
                data = read_bytes(image.path) if image.path else None
            except Error:
                return None
        if data is None:
            return None
        if data not in self.files:
            self.files.append(data)
        return {"file": self.files.index(data), "mimeType": _mime(data)}


def _mime(data: bytes) -> str:
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return "image/png"
    if data[:3] == b"\xff\xd8\xff":
        return "image/jpeg"
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    return "image/ktx2" if data[1:7] == b"KTX 20" else "application/octet-stream"


def write_materials(
    materials: list[Material], textures: str, folder: Path
) -> tuple[str, list[bytes]]:
    """The section MTRL, and the files that it refers to. `textures`: "embed" their images, leave
    them "external" where they are files (named from `folder`), or "none"."""
    if textures not in ("embed", "external", "none"):
        raise Error(f"textures must be 'embed', 'external' or 'none', not {textures!r}")
    writer = _Writer(textures, folder)
    if textures == "none":
        root: Json = {"materials": [write_material(material) for material in materials]}
    else:
        root = {"materials": [writer.material(material) for material in materials], **writer.root}
    root = {key: value for key, value in root.items() if value}
    used = sorted(_extensions(root.get("materials", [])))
    if used:
        root["extensionsUsed"] = used
    return encode(root), writer.files


def _extensions(value: Any) -> set[str]:
    if isinstance(value, list):
        return set().union(*(_extensions(item) for item in value))
    if not isinstance(value, dict):
        return set()
    return set(value.get("extensions", {})).union(*(_extensions(v) for v in value.values()))


def read_materials(text: str, file: Callable[[int], bytes], folder: Path | None) -> list[Material]:
    """The materials of a section MTRL. Images outside are looked for in `folder` and below; what is
    wrong with them, or not there, is left out."""
    try:
        root = json.loads(text or "{}")
        entries = root.get("materials", [])
        materials = [read_material(entry, root) for entry in entries]
    except (ValueError, TypeError, AttributeError) as error:
        raise Error(f"the materials are no glTF ({error})") from None
    for material in materials:
        for slot, info in material.textures.items():
            image = info.pop("image", None)
            if isinstance(image, dict):
                made = _image(image, root, info, file, folder)
                if made is not None:
                    material.images[slot] = made
    return materials


def _image(
    image: Json, root: Json, info: Json, file: Callable[[int], bytes], folder: Path | None
) -> TextureImage | None:
    try:
        texture = root["textures"][info["index"]]
        sampler = root.get("samplers", [])[texture["sampler"]] if "sampler" in texture else {}
        wrap = [_WRAP_NAMES.get(sampler.get(k, 0), "repeat") for k in ("wrapS", "wrapT")]
        nearest = sampler.get("magFilter") == _NEAREST
        if "file" in image:
            return TextureImage(file(int(image["file"])), None, wrap[0], wrap[1], nearest)
        path = beside(folder, urllib.parse.unquote(str(image["uri"])))
        if path is None:
            return None
        return TextureImage(None, path, wrap[0], wrap[1], nearest)
    except (KeyError, IndexError, TypeError, ValueError):
        return None
