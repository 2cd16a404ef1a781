"""Images of glTF files: embedded, in data URIs, or in files beside the asset."""

from __future__ import annotations

import urllib.parse

from umbel.errors import Error
from umbel.io.gltf_buffers import Buffers, Json, data_uri
from umbel.io.gltf_textures import Source, TextureReader
from umbel.io.images import beside


def texture_reader(buffers: Buffers) -> TextureReader:
    """The textures of a file. What is damaged or leads out of the file's folder is left out; the
    mesh does not depend on it."""
    return TextureReader(buffers.root, lambda entry: _source(entry, buffers))


def _source(entry: Json, buffers: Buffers) -> Source:
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
