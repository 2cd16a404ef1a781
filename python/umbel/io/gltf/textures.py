"""Textures of glTF: an image, how it is filtered and repeated, and what replaces it where a
reader does not know its format."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from umbel.io.textures.images import TextureImage, mime_type

Json = dict[str, Any]

_WRAPS = {"clamp": 33071, "mirror": 33648, "repeat": 10497}
_WRAP_NAMES = {number: name for name, number in _WRAPS.items()}
_NEAREST, _LINEAR = 9728, 9729
#: The extension that a texture needs for an image that is neither PNG nor JPEG.
_BY_TYPE = {
    "image/webp": "EXT_texture_webp",
    "image/ktx2": "KHR_texture_basisu",
    "image/avif": "EXT_texture_avif",
    "image/vnd-ms.dds": "MSFT_texture_dds",
}
SOURCES = frozenset(_BY_TYPE.values())
#: Takes coordinates that count from an image's bottom to those from its top.
FLIPPED = {"offset": [0, 1], "scale": [1, -1]}

Source = tuple["bytes | None", "Path | None"]


class TextureReader:
    """The images of a file's textures by their indices. `load` gives the bytes of an entry of the
    file's `images`, or the file that it names; what is damaged or not there is left out."""

    def __init__(self, root: Json, load: Callable[[Json], Source]) -> None:
        self._root, self._load = root, load
        self._sources: dict[int, Source] = {}
        self._made: dict[int, TextureImage | None] = {}
        #: Textures that a material names and that have no image.
        self.missing: set[int] = set()

    @property
    def idle(self) -> int:
        """Images of the file that no texture so far has asked for."""
        images = self._root.get("images")
        return len(images) - len(self._sources) if isinstance(images, list) else 0

    def image(self, index: Any) -> TextureImage | None:
        """That of texture `index`."""
        if not isinstance(index, int) or isinstance(index, bool):
            return None
        if index not in self._made:
            self._made[index] = self._texture(index)
        return self._made[index]

    def _texture(self, index: int) -> TextureImage | None:
        texture = _entry(self._root, "textures", index)
        extensions = texture.get("extensions")
        extensions = extensions if isinstance(extensions, dict) else {}
        known = {name: e["source"] for name, e in extensions.items() if _has_source(e)}
        rest = {k: v for k, v in texture.items() if k in ("name", "extras")}
        others = {name: e for name, e in extensions.items() if name not in known}
        if others:
            rest["extensions"] = others
        sampler = _entry(self._root, "samplers", texture.get("sampler"))
        made: TextureImage | None = None
        self.missing.add(index)
        for name, source in {"": texture.get("source"), **known}.items():
            entry = _entry(self._root, "images", source)
            if entry:
                self.missing.discard(index)
                made = self._image(name, source, entry, sampler, rest, made) or made
        return made

    def _image(
        self,
        extension: str,
        source: int,
        entry: Json,
        sampler: Json,
        rest: Json,
        fallback: TextureImage | None,
    ) -> TextureImage | None:
        if source not in self._sources:
            self._sources[source] = self._load(entry)
        data, path = self._sources[source]
        if data is None and path is None:
            return None
        image = {k: v for k, v in entry.items() if k in ("name", "extras", "extensions")}
        if data is not None and not mime_type(data) and "mimeType" in entry:
            image["mimeType"] = entry["mimeType"]
        said = {"image": image, "texture": rest, "sampler": sampler}
        return TextureImage(
            data,
            path,
            _WRAP_NAMES.get(sampler.get("wrapS", 0), "repeat"),
            _WRAP_NAMES.get(sampler.get("wrapT", 0), "repeat"),
            sampler.get("magFilter") == _NEAREST,
            gltf={key: value for key, value in said.items() if value},
            extension=extension,
            fallback=fallback,
        )


def _entry(root: Json, table: str, index: Any) -> Json:
    entries = root.get(table)
    if not isinstance(entries, list) or not isinstance(index, int) or isinstance(index, bool):
        return {}
    entry = entries[index] if 0 <= index < len(entries) else {}
    return entry if isinstance(entry, dict) else {}


def _has_source(extension: Any) -> bool:
    return isinstance(extension, dict) and isinstance(extension.get("source"), int)


class TextureTable:
    """The images, samplers and textures of a file that is written, equal ones once.

    store: gives the JSON of an image that a slot uses, with where its bytes are; None leaves the
        texture out.
    """

    def __init__(self, store: Callable[[str, TextureImage], Json | None]) -> None:
        self._store = store
        self.root: dict[str, list[Any]] = {"images": [], "samplers": [], "textures": []}
        self._numbers: dict[tuple[str, str], int] = {}  # of a table's entries
        #: Extensions that a reader must know to show all of the textures.
        self.required: set[str] = set()

    def info(self, slot: str, given: Json, image: TextureImage) -> Json | None:
        """A textureInfo: what the file said of it, at a texture of ours."""
        index = self._texture(slot, image)
        if index is None:
            return None
        info = {**given, "index": index}
        if image.bottom_up:
            own = {**info.get("extensions", {}), "KHR_texture_transform": FLIPPED}
            info["extensions"] = own
        return info

    def _texture(self, slot: str, image: TextureImage) -> int | None:
        said = image.gltf.get("texture", {})
        texture: Json = {k: v for k, v in said.items() if k != "extensions"}
        extensions: Json = dict(said.get("extensions", {}))
        one: TextureImage | None = image
        while one is not None:
            entry = self._store(slot, one)
            if entry is not None:
                name = _BY_TYPE.get(entry.get("mimeType", ""), one.extension)
                # An image that was a file of its own is known by the file's name.
                named = {} if one.path is None or "uri" in entry else {"name": one.path.stem}
                source = self._index("images", {**named, **one.gltf.get("image", {}), **entry})
                if name:
                    extensions.setdefault(name, {"source": source})
                else:
                    texture.setdefault("source", source)
            one = one.fallback
        if extensions:
            texture["extensions"] = extensions
        sources = [name for name in extensions if _has_source(extensions[name])]
        if "source" not in texture:
            if not sources:
                return None
            self.required.update(sources)
        sampler = _sampler(image)
        if sampler:
            texture["sampler"] = self._index("samplers", sampler)
        return self._index("textures", texture)

    def _index(self, table: str, entry: Json) -> int:
        key = table, json.dumps(entry, sort_keys=True, default=repr)
        if key not in self._numbers:
            self._numbers[key] = len(self.root[table])
            self.root[table].append(entry)
        return self._numbers[key]


def _sampler(image: TextureImage) -> Json:
    """The file's own, changed only where the image says otherwise."""
    sampler: Json = dict(image.gltf.get("sampler", {}))
    for key, wrap in (("wrapS", image.wrap_u), ("wrapT", image.wrap_v)):
        if _WRAP_NAMES.get(sampler.get(key, 0), "repeat") != wrap:
            sampler[key] = _WRAPS[wrap]
    if image.nearest != (sampler.get("magFilter") == _NEAREST):
        sampler["magFilter"] = _NEAREST if image.nearest else _LINEAR
    return sampler
