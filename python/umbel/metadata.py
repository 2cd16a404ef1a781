"""The JSON that travels in an asset: what made it, from what, and its materials. The same build
gives the same text, so it holds no times and no paths."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import Any

from .mesh import Material

_TUPLES = ("base_color", "emissive")
_KNOWN = {field.name for field in fields(Material)}


def materials_to_json(materials: list[Material]) -> list[dict[str, Any]]:
    """Each material as a dict of its fields."""
    return [asdict(material) for material in materials]


def materials_from_json(items: list[dict[str, Any]]) -> list[Material]:
    """The materials again; fields that this version does not know are left out."""
    materials = []
    for item in items:
        known = {key: value for key, value in item.items() if key in _KNOWN}
        for key in _TUPLES:
            if key in known:
                known[key] = tuple(known[key])
        materials.append(Material(**known))
    return materials


def encode(metadata: dict[str, Any]) -> str:
    return json.dumps(metadata, sort_keys=True, separators=(",", ":"), allow_nan=False)
