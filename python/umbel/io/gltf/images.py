"""Images of glTF files: embedded, in data URIs, or in files beside the asset."""

from __future__ import annotations

from collections.abc import Callable

from umbel.errors import Error
from umbel.io.gltf.buffers import Buffers, Json, data_uri, is_data_uri
from umbel.io.gltf.textures import Source, TextureReader


def texture_reader(
    buffers: Buffers, lost: list[str], view: Callable[[int], bytes] | None = None
) -> TextureReader:
    """The textures of a file. What is damaged or outside the file's folder is left out, and a
    sentence added to `lost`; the mesh does not depend on it. A file that is missing is for its
    user to name. `view` gives the bytes of a buffer view where `buffers` do not have them."""
    read = view or (lambda index: buffers.view(index, "an image")[0])
    return TextureReader(buffers.root, lambda entry: _source(entry, buffers, lost, read))


def _source(entry: Json, buffers: Buffers, lost: list[str], view: Callable[[int], bytes]) -> Source:
    uri = entry.get("uri")
    try:
        if is_data_uri(uri):
            return data_uri(uri, "an image"), None
        if isinstance(uri, str) and buffers.folder is not None:
            return None, buffers.folder.find_uri(uri, may_miss=True)
        if "bufferView" in entry:
            return view(entry["bufferView"]), None
    except Error as error:
        sentence = str(error).removeprefix(f"{buffers.where}: ")
        lost.append(f"an image: {sentence}")
    return None, None
