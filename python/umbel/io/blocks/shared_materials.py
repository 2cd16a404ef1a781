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
        self._known = 0  #: of them, those whose keys are in `_first`
        self._first: dict[str, int] = {}
        self._digests: dict[str, str] = {}

    def add(self, materials: list[Material]) -> list[int]:
        """The number of each; one of an earlier file where that is equal."""
        if not self.all:
            # A single file needs no keys, so its images are not read.
            self.all += materials
            return list(range(len(materials)))
        for known in range(self._known, len(self.all)):
            self._first.setdefault(self._key(self.all[known]), known)
        keys = [self._key(material) for material in materials]
        earlier = [self._first.get(key) for key in keys]
        numbers: list[int] = []
        for material, key, number in zip(materials, keys, earlier, strict=True):
            if number is None:
                number = len(self.all)
                self.all.append(material)
                self._first.setdefault(key, number)
            numbers.append(number)
        self._known = len(self.all)
        return numbers

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
