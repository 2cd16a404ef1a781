"""The materials and images of a glTF file that is written."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np

from umbel.errors import Error
from umbel.geometry.mesh import Material
from umbel.io.gltf.arrays import Json
from umbel.io.gltf.materials import CLAMPED, is_clamped, texture_sets, write_material
from umbel.io.gltf.textures import TextureTable
from umbel.io.textures.images import TextureImage, decode, mime_type
from umbel.io.textures.packed import Made, packed

#: What is lost where a mesh has not as many texture coordinates as its material names.
FEWER = "textures of meshes that lack their texture coordinates"


class MaterialTable:
    """The file's materials: all that are given in their order, and after them those that had to
    lose a texture because a mesh lacks its UVs.

    keep: takes an image's bytes and MIME type, and gives the JSON that says where they are.
    lost: gets a sentence for each image that cannot be read, and one each for factors that glTF
        forbids and for textures that meshes cannot have.
    """

    def __init__(
        self, keep: Callable[[bytes, str], Json], materials: list[Material], lost: list[str]
    ) -> None:
        self.keep, self.materials, self.lost = keep, list(materials), lost
        self.table = TextureTable(self._store)
        self.entries: list[Json] = []
        self._fewer: dict[tuple[int, int], int] = {}

    def write(self) -> None:
        self.lost += [CLAMPED] if any(map(is_clamped, self.materials)) else []
        made: Made = {}
        for k, material in enumerate(self.materials):
            self.materials[k], lost = packed(material, made)
            self.lost += dict.fromkeys(what for what in lost if what not in self.lost)
            self.entries.append(write_material(self.materials[k], self.table.info))

    def number(self, index: int, sets: int) -> int:
        """That of a material for a mesh with so many sets of UVs."""
        if texture_sets(self.entries[index]) <= sets:
            return index
        key = index, sets
        if key not in self._fewer:

            def info(slot: str, given: Json, image: TextureImage) -> Json | None:
                made = self.table.info(slot, given, image)
                return made if made is not None and texture_sets({slot: made}) <= sets else None

            self.lost += [FEWER] if FEWER not in self.lost else []
            self._fewer[key] = len(self.entries)
            self.entries.append(write_material(self.materials[index], info))
        return self._fewer[key]

    def _store(self, slot: str, image: TextureImage) -> Json | None:
        try:
            data = image.encoded()
            kind = mime_type(data)
            if not kind:  # glTF knows no other formats
                data, kind = _as_png(data, image), "image/png"
        except Error as error:
            if str(error) not in self.lost:
                self.lost.append(str(error))
            return None
        return {**self.keep(data, kind), "mimeType": kind}


def _as_png(data: bytes, image: TextureImage) -> bytes:
    from PIL import Image

    texels = decode(data, str(image.path or "an image"))
    out = io.BytesIO()
    opaque = bool((texels[..., 3] == 255).all())
    Image.fromarray(np.ascontiguousarray(texels[..., :3]) if opaque else texels).save(out, "PNG")
    return out.getvalue()
