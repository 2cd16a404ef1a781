"""The JSON that travels in an asset: what made it, from what, and its materials. The same build
gives the same text, so it holds no times and no paths."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, fields, replace
from typing import Any

from .mesh import Material

_TUPLES = ("base_color", "emissive")
_KNOWN = {field.name for field in fields(Material)} - {"images"}


def materials_to_json(materials: list[Material]) -> list[dict[str, Any]]:
    """Each material as a dict of its fields, without its images."""
    items = []
    for material in materials:
        item = asdict(replace(material, images={}))
        del item["images"]
        items.append(item)
    return items


def materials_from_json(items: list[dict[str, Any]]) -> list[Material]:
    """The materials again; fields that this version does not know are left out."""
    materials = []
    for item in items:
        known = {key: value for key, value in item.items() if key in _KNOWN}
        for key in _TUPLES:
            if key in known:
                known[key] = tuple(0.0 if v is None else v for v in known[key])
        materials.append(Material(**known))
    return materials


def plain(value: Any) -> Any:
    """The value as JSON and any terminal can say it: tuples as lists, NumPy's numbers as plain
    ones, None for what is not finite, "?" for what is no text."""
    if isinstance(value, dict):
        return {plain(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode()
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def encode(metadata: dict[str, Any]) -> str:
    """The metadata as text; equal metadata give equal text."""
    return json.dumps(plain(metadata), sort_keys=True, separators=(",", ":"), allow_nan=False)
