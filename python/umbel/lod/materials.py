"""Materials as an asset keeps them: glTF's own JSON, with images beside it as files."""

from __future__ import annotations

import json
import os
import urllib.parse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from umbel.errors import Error, warn_lost
from umbel.geometry.mesh import Material
from umbel.io.gltf.materials import (
    CLAMPED,
    extensions_in,
    is_clamped,
    read_material,
    write_material,
)
from umbel.io.gltf.textures import Source, TextureReader, TextureTable
from umbel.io.textures.images import TextureImage, beside, mime_type
from umbel.io.textures.levels import add_levels
from umbel.io.textures.packed import Made, packed
from umbel.plain_json import encode

Json = dict[str, Any]


class _Files:
    """The images of an asset: embedded files, or where they are from its folder."""

    def __init__(self, external: bool, folder: Path) -> None:
        self.external, self.folder = external, folder
        self.files: list[bytes] = []
        self.slots: list[set[str]] = []
        """What each of them is used for."""
        self.lost: dict[str, None] = {}
        """What is wrong with images that cannot be read."""
        self._numbers: dict[bytes, int] = {}

    def store(self, slot: str, image: TextureImage) -> Json | None:
        """The entry of an image; None where it cannot be read."""
        if self.external and image.path is not None and (uri := self._address(image.path)):
            return {"uri": uri}
        try:
            data = image.encoded()
        except Error as error:
            self.lost[str(error)] = None
            return None
        number = self._numbers.setdefault(data, len(self.files))
        if number == len(self.files):
            self.files.append(data)
            self.slots.append(set())
        self.slots[number].add(slot)
        kind = mime_type(data) or image.gltf.get("image", {}).get("mimeType")
        return {"file": number, "mimeType": kind or "application/octet-stream"}

    def _address(self, path: Path) -> str:
        """The URI of a file that readers of an asset find: they look in its folder and below, and
        not for every name. "" for others."""
        relative = os.path.relpath(path, self.folder).replace(os.sep, "/")
        try:
            uri = urllib.parse.quote(relative)
        except UnicodeEncodeError:  # a name that is no text
            return ""
        return uri if beside(self.folder, relative) == self.folder / relative else ""


def write_materials(
    materials: list[Material], textures: str, folder: Path, threads: int = 0
) -> tuple[str, list[bytes]]:
    """The section MTRL, and the files that it refers to. `textures`: "embed" their images with
    smaller copies of large ones, leave them "external" where they are files in `folder` and below,
    or "none"."""
    if textures not in ("embed", "external", "none"):
        raise Error(f"textures must be 'embed', 'external' or 'none', not {textures!r}")
    files = _Files(textures == "external", folder)
    table = TextureTable(files.store)
    reference = None if textures == "none" else table.info
    written = []
    made: Made = {}
    for material in materials:
        ours, lost = packed(material, made) if reference else (material, [])
        files.lost |= dict.fromkeys(lost)
        written.append(write_material(ours, reference))
    root: Json = {"materials": written, **table.root}
    stored = files.files
    if textures == "embed":
        stored = add_levels(root["images"], files.files, files.slots, threads)
    if any(map(is_clamped, materials)):
        warn_lost("the asset was written without", [CLAMPED])
    if files.lost:
        warn_lost("the asset has not all textures", list(files.lost))
    used = sorted(extensions_in(root))
    root |= {"extensionsUsed": used, "extensionsRequired": sorted(table.required)}
    return encode({key: value for key, value in root.items() if value}), stored


def read_materials(text: str, file: Callable[[int], bytes], folder: Path | None) -> list[Material]:
    """The materials of a section MTRL. Images outside are looked for in `folder` and below; what is
    wrong with them, or not there, is left out."""

    def load(entry: Json) -> Source:
        try:
            if "file" in entry:
                return file(int(entry["file"])), None
            return None, beside(folder, urllib.parse.unquote(str(entry["uri"])))
        except (KeyError, IndexError, TypeError, ValueError):
            return None, None

    try:
        root = json.loads(text or "{}")
        textures = TextureReader(root, load)
        return [read_material(entry, textures.image) for entry in root.get("materials", [])]
    except (ValueError, TypeError, AttributeError) as error:
        raise Error(f"the materials are no glTF ({error})") from None
