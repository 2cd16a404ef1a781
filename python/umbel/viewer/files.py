"""The files that an asset names beside itself: images that were not embedded."""

from __future__ import annotations

import json
import re
import urllib.parse
from pathlib import Path

from umbel.io.textures.images import beside
from umbel.lod.asset import Asset

#: What the page shows. An asset from anywhere may not have any file shown that it names.
_KINDS = {".png", ".jpg", ".jpeg", ".webp", ".avif", ".ktx2", ".gif", ".bmp"}


def images_named(asset: Path) -> list[str]:
    """The names that an asset has for images beside it."""
    try:
        images = json.loads(Asset(asset)._native.materials or "{}").get("images", [])
        names = [image["uri"] for image in images if isinstance(image.get("uri"), str)]
    except (ValueError, TypeError, AttributeError):
        return []
    return [urllib.parse.unquote(name) for name in names]


def images_beside(asset: Path) -> dict[str, Path]:
    """Those of them that are in the asset's folder or below it, by the name that it has for each.

    What is elsewhere, or not there, is left out: the viewer says that it could not be read."""
    found: dict[str, Path] = {}
    for name in images_named(asset):
        path = beside(asset.absolute().parent, name)
        if path is not None and path.suffix.lower() in _KINDS and path.is_file():
            found[name] = path
    return found


def served_name(asset: Path) -> str:
    """The name that pages know an asset by: its own, without what is no text."""
    return re.sub("[\ud800-\udfff]", "_", asset.name)


def address_of(asset: Path) -> str:
    """That name as a relative address, with what means something there, or gets lost, encoded."""
    return re.sub(
        r"[#?%:\\\x00-\x1f]|^ +",
        lambda found: urllib.parse.quote(found.group()),
        served_name(asset),
    )
