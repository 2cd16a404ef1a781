"""Materials of several files, each once: tiles of one scene name the same ones."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from typing import Any

from umbel.errors import Error
from umbel.geometry.mesh import Material
from umbel.io.textures.images import TextureImage


class SharedMaterials:
    """Collects the materials of one file after the other. Those of one file stay apart, as they do
    where it is the only one."""

    def __init__(self) -> None:
        self.all: list[Material] = []
        self._keys: list[str] = []
        self._digests: dict[str, str] = {}

    def add(self, materials: list[Material]) -> list[int]:
        """The number of each; one of an earlier file where that is equal."""
        if not self.all:
            self.all += materials
            return list(range(len(materials)))
        keys = self._keys_with(materials)
        earlier = {key: k for k, key in reversed(list(enumerate(self._keys)))}
        numbers = []
        for material, key in zip(materials, keys, strict=True):
            if key not in earlier:
                self.all.append(material)
                self._keys.append(key)
            numbers.append(earlier.get(key, len(self.all) - 1))
        return numbers

    def add_in_order(self, materials: list[Material]) -> int:
        """The number of the first, where the others follow it."""
        if not self.all:
            self.all += materials
            return 0
        keys = self._keys_with(materials)
        for at in range(len(self._keys) - len(keys) + 1):
            if self._keys[at : at + len(keys)] == keys:
                return at
        self.all += materials
        self._keys += keys
        return len(self.all) - len(materials)

    def _keys_with(self, materials: list[Material]) -> list[str]:
        # A single file needs no keys, so its images are not read.
        self._keys += [self._key(material) for material in self.all[len(self._keys) :]]
        return [self._key(material) for material in materials]

    def _key(self, material: Material) -> str:
        """A text that is equal for equal materials."""
        fields = {f.name: getattr(material, f.name) for f in dataclasses.fields(material)}
        fields["images"] = {slot: self._image(image) for slot, image in material.images.items()}
        return json.dumps(fields, sort_keys=True, default=repr)

    def _image(self, image: TextureImage) -> dict[str, Any]:
        fields = {f.name: getattr(image, f.name) for f in dataclasses.fields(image)}
        place = None if image.path is None else str(image.path.absolute())
        digest = None if place is None else self._digests.get(place)
        if digest is None:
            try:
                digest = hashlib.sha256(image.encoded()).hexdigest()
            except Error:
                digest = f"unreadable: {place}"
            if place is not None:
                self._digests[place] = digest
        fallback = None if image.fallback is None else self._image(image.fallback)
        return {**fields, "data": digest, "path": None, "fallback": fallback}
