"""Images of glTF's textures: embedded, in data URIs, or in files beside the asset."""

from __future__ import annotations

import urllib.parse
from pathlib import Path
from typing import Any

from umbel.errors import Error
from umbel.io.gltf_buffers import Buffers, Json, data_uri
from umbel.io.images import TextureImage, beside
from umbel.mesh import Material

_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
_NEAREST = 9728


def attach_images(materials: list[Material], buffers: Buffers) -> None:
    """Fills `images` of each material for the slots of its `textures`. What is damaged or leads
    out of the asset's folder is left out; the mesh does not depend on it."""
    sources: dict[int, tuple[bytes | None, Path | None]] = {}
    for material in materials:
        for slot, info in material.textures.items():
            entry = info.get("image")
            if not isinstance(entry, dict):
                continue
            if id(entry) not in sources:
                sources[id(entry)] = _source(entry, buffers)
            data, path = sources[id(entry)]
            if data is not None or path is not None:
                material.images[slot] = TextureImage(data, path, **_sampler(info, buffers.root))


def _source(entry: Json, buffers: Buffers) -> tuple[bytes | None, Path | None]:
    uri = entry.get("uri")
    try:
        if isinstance(uri, str) and uri.startswith("data:"):
            return data_uri(uri, "an image"), None
        if isinstance(uri, str):
            return None, beside(buffers.folder, urllib.parse.unquote(uri))
        if "bufferView" in entry:
            return buffers.view(entry["bufferView"], "an image")[0], None
    except Error:
        pass
    return None, None


def _sampler(info: Json, root: Json) -> dict[str, Any]:
    """Wrapping and filter of a texture, glTF's defaults where the file is wrong."""
    try:
        sampler = root["samplers"][root["textures"][info["index"]]["sampler"]]
        return {
            "wrap_u": _WRAPS.get(sampler.get("wrapS"), "repeat"),
            "wrap_v": _WRAPS.get(sampler.get("wrapT"), "repeat"),
            "nearest": sampler.get("magFilter") == _NEAREST,
        }
    except (KeyError, IndexError, TypeError, AttributeError):
        return {}
