"""The properties that glTF 2.0 has, to warn of others: a misspelt or damaged name would be ignored
without a word."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

_COMMON = frozenset({"extensions", "extras"})
#: Allowed names by the path of the object, "*" for every item of an array.
_NAMES = {
    "": "asset extensionsUsed extensionsRequired scene scenes nodes meshes accessors bufferViews "
    "buffers materials textures images samplers skins cameras animations",
    "asset": "version minVersion generator copyright",
    "scenes/*": "nodes",
    "nodes/*": "camera children skin matrix mesh rotation scale translation weights",
    "meshes/*": "primitives weights",
    "meshes/*/primitives/*": "attributes indices material mode targets",
    "accessors/*": "bufferView byteOffset componentType normalized count type max min sparse",
    "accessors/*/sparse": "count indices values",
    "accessors/*/sparse/indices": "bufferView byteOffset componentType",
    "accessors/*/sparse/values": "bufferView byteOffset",
    "bufferViews/*": "buffer byteOffset byteLength byteStride target",
    "buffers/*": "uri byteLength",
    "materials/*": "pbrMetallicRoughness normalTexture occlusionTexture emissiveTexture "
    "emissiveFactor alphaMode alphaCutoff doubleSided",
    "materials/*/pbrMetallicRoughness": "baseColorFactor baseColorTexture metallicFactor "
    "roughnessFactor metallicRoughnessTexture",
    "textures/*": "sampler source",
    "images/*": "uri mimeType bufferView",
    "samplers/*": "magFilter minFilter wrapS wrapT",
    "skins/*": "inverseBindMatrices skeleton joints",
}
#: What is in the file's own tables may have a name.
_ALLOWED = {
    path: _COMMON | set(names.split()) | ({"name"} if path.count("/") == 1 else set())
    for path, names in _NAMES.items()
}


def unknown_properties(root: dict[str, Any]) -> Iterator[str]:
    """The places of properties that glTF does not have, such as "nodes[3].mesj"."""
    yield from _unknown(root, "", "")


def _unknown(value: Any, path: str, place: str) -> Iterator[str]:
    if isinstance(value, list):
        for k, item in enumerate(value):
            yield from _unknown(item, f"{path}/*", f"{place}[{k}]")
    allowed = _ALLOWED.get(path)
    if allowed is None or not isinstance(value, dict):
        return
    for name, item in value.items():
        inner = f"{place}.{name}" if place else name
        if name not in allowed:
            yield inner
        elif isinstance(item, (dict, list)) and name not in _COMMON:
            yield from _unknown(item, f"{path}/{name}" if path else name, inner)
