"""The types that the reader counts on in a glTF asset's JSON, checked before anything is read."""

from __future__ import annotations

import math
from typing import Any

from umbel.errors import Error

Json = dict[str, Any]

_INDICES = ["integer"]
_NUMBERS = ["number"]
_TEXTURE = {"index": "integer"}
_STREAM = {
    "buffer": "integer", "byteOffset": "integer", "byteLength": "integer",
    "byteStride": "integer", "count": "integer", "mode": "text", "filter": "text",
}  # fmt: skip
_EXTENSIONS = {"*": "object"}

#: A key's type: a word, [type of the items], or {key: type}; "*" stands for every other key.
_SCHEMA: Json = {
    "asset": {"version": "text"},
    "extensionsRequired": ["text"],
    "extensionsUsed": ["text"],
    "scene": "integer",
    "scenes": [{"nodes": _INDICES}],
    "nodes": [
        {
            "mesh": "integer", "skin": "integer", "children": _INDICES, "name": "text",
            "camera": "integer",
            "matrix": _NUMBERS, "translation": _NUMBERS, "rotation": _NUMBERS, "scale": _NUMBERS,
            "weights": _NUMBERS,
            "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"*": "integer"}},
                           **_EXTENSIONS},
        }
    ],
    "meshes": [
        {
            "name": "text",
            "weights": _NUMBERS,
            "primitives": [
                {
                    "attributes": {"*": "integer"}, "indices": "integer", "mode": "integer",
                    "material": "integer", "targets": [{"*": "integer"}],
                    "extensions": {
                        "KHR_draco_mesh_compression": {"bufferView": "integer",
                                                       "attributes": {"*": "integer"}},
                        **_EXTENSIONS,
                    },
                }
            ],
        }
    ],
    "cameras": [{"name": "text", "perspective": {"yfov": "number"}}],
    "skins": [{"joints": _INDICES, "inverseBindMatrices": "integer", "skeleton": "integer"}],
    "accessors": [
        {
            "bufferView": "integer", "byteOffset": "integer", "componentType": "integer",
            "count": "integer", "type": "text", "normalized": "flag",
            "sparse": {
                "count": "integer",
                "indices": {"bufferView": "integer", "byteOffset": "integer",
                            "componentType": "integer"},
                "values": {"bufferView": "integer", "byteOffset": "integer"},
            },
        }
    ],
    "bufferViews": [
        {
            **_STREAM,
            "extensions": {"EXT_meshopt_compression": _STREAM, "KHR_meshopt_compression": _STREAM,
                           **_EXTENSIONS},
        }
    ],
    "buffers": [{"byteLength": "integer", "uri": "text", "extensions": _EXTENSIONS}],
    "materials": [
        {
            "name": "text", "emissiveFactor": _NUMBERS, "doubleSided": "flag",
            "alphaMode": "text", "alphaCutoff": "number", "normalTexture": _TEXTURE,
            "occlusionTexture": _TEXTURE, "emissiveTexture": _TEXTURE,
            "pbrMetallicRoughness": {
                "baseColorFactor": _NUMBERS, "metallicFactor": "number",
                "roughnessFactor": "number", "baseColorTexture": _TEXTURE,
                "metallicRoughnessTexture": _TEXTURE,
            },
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": "number"},
                "KHR_materials_pbrSpecularGlossiness": {
                    "diffuseFactor": _NUMBERS, "glossinessFactor": "number",
                    "diffuseTexture": _TEXTURE,
                },
                **_EXTENSIONS,
            },
        }
    ],
}  # fmt: skip


def check_schema(root: Json, where: str) -> None:
    """Raises, naming the place, where an entry that the reader looks at has another type than
    glTF gives it. An entry of null counts as absent and is taken out."""
    _check(root, _SCHEMA, "", where)


def _check(value: Any, expected: Any, place: str, where: str) -> None:
    if isinstance(expected, dict):
        if not isinstance(value, dict):
            raise _wrong(value, "an object", place, where)
        for key in [k for k, v in value.items() if v is None]:
            del value[key]
        for key, item in list(value.items()):
            inner = expected.get(key, expected.get("*"))
            if inner == "integer" and isinstance(item, float) and item.is_integer():
                value[key] = item = int(item)  # some writers know no integers
            if inner is not None:
                _check(item, inner, f"{place}.{key}" if place else key, where)
    elif isinstance(expected, list):
        if not isinstance(value, list):
            raise _wrong(value, "an array", place, where)
        if expected[0] == "number" or expected[0] == "integer":
            _check_all(value, expected[0], place, where)
        else:
            for k, item in enumerate(value):
                _check(item, expected[0], f"{place}[{k}]", where)
    elif not _is(value, expected):
        raise _wrong(value, _named(expected), place, where)


def _check_all(values: list[Any], expected: str, place: str, where: str) -> None:
    for k, value in enumerate(values):
        if expected == "integer" and isinstance(value, float) and value.is_integer():
            values[k] = value = int(value)
        if not _is(value, expected):
            raise _wrong(value, _named(expected), f"{place}[{k}]", where)


def _is(value: Any, kind: str) -> bool:
    if kind == "integer":
        return isinstance(value, int) and not isinstance(value, bool)
    if kind == "number":
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return False
        return abs(value) < 1e300 if isinstance(value, int) else math.isfinite(value)
    return isinstance(value, {"text": str, "flag": bool, "object": dict}[kind])


def _named(kind: str) -> str:
    return f"{'an' if kind[0] in 'io' else 'a'} {kind}"


def _wrong(value: Any, expected: str, place: str, where: str) -> Error:
    shown = repr(value)
    shown = shown if len(shown) <= 40 else f"{shown[:37]}..."
    return Error(f"{where}: {place or 'its JSON'} should be {expected}, not {shown}")
