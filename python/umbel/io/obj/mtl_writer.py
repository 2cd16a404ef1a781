"""Writes material libraries of OBJ with their images."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.geometry.mesh import Material
from umbel.io.obj.mtl import unique_names
from umbel.io.side_names import SideNames
from umbel.io.textures.images import TextureImage, mime_type

_MAPS = {"base_color": "map_Kd", "emissive": "map_Ke", "normal": "norm"}
_OBJ_MAPS = {"alpha": "map_d", "roughness": "map_Pr", "metallic": "map_Pm", "specular": "map_Ks"}
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg"}
#: How both coordinates may address an image.
_WRAPS = (("repeat", "repeat"), ("clamp", "clamp"))
_COAT, _IOR = "KHR_materials_clearcoat", "KHR_materials_ior"
_COAT_FACTORS = {"clearcoatFactor": "Pc", "clearcoatRoughnessFactor": "Pcr"}
_CHANNELS = {"roughness": 1, "metallic": 2}
_HEAD, _WITH = b"# written by umbel\n", b"# with "
_SHOWN = 3  # names in a warning
_LONGEST = 1024  # more than a line of the head has


def readable(name: str) -> str:
    """A file's name as readers of OBJ find it in a line: where they would take a part for a
    comment, an option or the line's end, without those signs."""
    if name == " ".join(name.split()) and not re.search(r"^[-#]|\s#|\\", name):
        return name
    return re.sub(r"[^\w.-]+", "_", name).strip("-") or "_"


def encoded(text: str) -> bytes:
    """The bytes of a text in which names of files may be no text."""
    return text.encode("utf-8", "surrogateescape")


def head(ours: Iterable[str]) -> bytes:
    """The first lines of an OBJ file, which say what files were written with it."""
    return b"".join([_HEAD, *(_WITH + encoded(f"{name}\n") for name in ours)])


def written_with(path: Path) -> set[str]:
    """The files that were written with an OBJ file, where it is ours."""
    found: set[str] = set()
    with contextlib.suppress(OSError), path.open("rb") as file:
        is_ours = file.readline(len(_HEAD)) == _HEAD
        while is_ours and (line := file.readline(_LONGEST)).startswith(_WITH):
            found.add(os.fsdecode(line.removeprefix(_WITH).rstrip(b"\n")))
    return found


class MtlWriter:
    """A library beside an OBJ file `path`, and its images.

    `files` are all of them by their names, `ours` those that may be replaced when the OBJ file is,
    `name` is the library's, `lost` says what it cannot hold. Where `flips`, the v of texture
    coordinates count from the image's top for most textures, and must be turned round for OBJ,
    which counts from the bottom.
    """

    def __init__(self, path: Path, materials: list[Material]) -> None:
        self.folder, self.stem = os.path.realpath(path.parent), readable(path.stem)
        self.names = unique_names(materials)
        self.files: dict[str, bytes] = {}
        self.name = ""
        self.lost: list[str] = []
        given = zip(materials, self.names, strict=True)
        renamed = [f"{m.name!r} ({name})" for m, name in given if m.name not in ("", name)]
        if renamed:
            more = ", ..." if len(renamed) > _SHOWN else ""
            self._say(f"some names of materials: {', '.join(renamed[:_SHOWN])}{more}")
        used = [
            (m.textures.get(slot, {}), image) for m in materials for slot, image in m.images.items()
        ]
        turned = [_is_turned(info, image) for info, image in used]
        self.flips = 2 * sum(turned) < len(turned)
        beside = [self._name_beside(image) for _, image in used]
        self._side_names = SideNames(path, written_with, filter(None, beside))
        self._named: dict[bytes, str] = {}
        #: Files of one channel, by the image, the channel and the factor.
        self._channels: dict[tuple[TextureImage, str, float], str] = {}
        written = [self._material(*one) for one in zip(materials, self.names, strict=True)]
        if written:
            text = encoded("\n".join(written))
            self.name = self._side_names.new(self.stem, ".mtl", [text])
            self.files[self.name] = text
        self.ours = self._side_names.ours

    def _material(self, material: Material, name: str) -> str:
        r, g, b, a = material.base_color
        a = 1.0 if material.alpha_mode == "OPAQUE" else a  # which then counts for nothing
        lines = [
            f"newmtl {name}",
            f"Kd {r:.9g} {g:.9g} {b:.9g}",
            f"d {a:.9g}",
            "Ke {:.9g} {:.9g} {:.9g}".format(*material.emissive),
            f"Pm {material.metallic:.9g}",
            f"Pr {material.roughness:.9g}",
            *self._extensions(material),
        ]
        for slot, image in material.images.items():
            lines += self._maps(material, slot, image)
        return "\n".join([*lines, ""])

    def _extensions(self, material: Material) -> list[str]:
        lines = []
        for name, extension in material.extensions.items():
            if name == _COAT:
                known = {k: v for k, v in extension.items() if k in _COAT_FACTORS}
                lines += [f"{_COAT_FACTORS[k]} {v:.9g}" for k, v in known.items()]
            elif name == _IOR:
                lines.append(f"Ni {extension.get('ior', 1.5):.9g}")
            else:
                self._say(name)
        if material.alpha_mode == "MASK":
            self._say("the cut-off of masks")
        if material.double_sided:
            self._say("which materials are double-sided")
        if material.extras is not None:
            self._say("extras of materials")
        return lines

    def _maps(self, material: Material, slot: str, image: TextureImage) -> list[str]:
        known = slot in _MAPS or slot in _OBJ_MAPS or slot == "metallic_roughness"
        options = self._options(material.textures.get(slot, {}), slot, image) if known else None
        if options is None:
            what = f"the {slot} textures"
            self._say(f"{what} that are turned or use further UVs" if known else what)
            return []
        if image.nearest or (image.wrap_u, image.wrap_v) not in _WRAPS:
            self._say("how textures are filtered or mirrored")
        try:
            if slot == "metallic_roughness":
                texels = functools.cache(image.texels)  # decoded once, and only if needed
                rough = self._channel(image, texels, "roughness", material.roughness)
                metal = self._channel(image, texels, "metallic", material.metallic)
                return [f"map_Pr{options} {rough}", f"map_Pm{options} {metal}"]
            file = self._file(image, slot)
        except Error as error:
            self._say(str(error))
            return []
        lines = [f"{_MAPS.get(slot) or _OBJ_MAPS[slot]}{options} {file}"]
        masks = slot == "base_color" and material.alpha_mode != "OPAQUE"
        if masks and "alpha" not in material.images:
            lines.append(f"map_d{options} {file}")
        return lines

    def _options(self, info: dict[str, Any], slot: str, image: TextureImage) -> str | None:
        """The map's transform; None where OBJ cannot express it."""
        moved = _transform(info)
        if moved.get("texCoord", info.get("texCoord", 0)) or moved.get("rotation", 0):
            return None
        default = ((0.0, 1.0), (1.0, -1.0)) if image.bottom_up else ((0.0, 0.0), (1.0, 1.0))
        offset, scale = moved.get("offset", default[0]), moved.get("scale", default[1])
        if self.flips:
            offset, scale = (offset[0], 1 - scale[1] - offset[1]), scale
        else:
            offset, scale = (offset[0], 1 - offset[1]), (scale[0], -scale[1])
        out = ""
        if slot == "normal" and info.get("scale", 1) != 1:
            out += f" -bm {info['scale']:.9g}"
        if any(offset):
            out += f" -o {offset[0]:.9g} {offset[1]:.9g} 0"
        if any(value != 1 for value in scale):
            out += f" -s {scale[0]:.9g} {scale[1]:.9g} 1"
        return out + (" -clamp on" if image.wrap_u == image.wrap_v == "clamp" else "")

    def _channel(
        self, image: TextureImage, texels: Callable[[], NDArray[np.uint8]], kind: str, factor: float
    ) -> str:
        """An image of one channel, times the material's factor: in OBJ a map replaces it."""
        from PIL import Image

        key = image, kind, factor
        if key not in self._channels:
            values = texels()[..., _CHANNELS[kind]] * float(factor)
            out = io.BytesIO()
            Image.fromarray(np.clip(np.rint(values), 0, 255).astype(np.uint8)).save(out, "PNG")
            base = f"{self._base(image, '')}_{kind}".strip("_")
            self._channels[key] = self._stored(out.getvalue(), base, ".png")
        return self._channels[key]

    def _name_beside(self, image: TextureImage) -> str:
        """That of the image's own file, where the library can name it."""
        path = image.path
        if path is None or not path.is_file() or os.path.realpath(path.parent) != self.folder:
            return ""
        return path.name if readable(path.name) == path.name else ""

    def _file(self, image: TextureImage, slot: str) -> str:
        if name := self._name_beside(image):
            return name
        data = image.encoded()
        suffix = _SUFFIXES.get(mime_type(data))
        if suffix is None and image.path is not None and not mime_type(data):
            suffix = image.path.suffix
        if suffix is None:  # of no format that readers of OBJ know
            from PIL import Image

            out = io.BytesIO()
            Image.fromarray(image.texels()).save(out, "PNG")
            data, suffix = out.getvalue(), ".png"
        return self._stored(data, self._base(image, slot), suffix)

    def _base(self, image: TextureImage, slot: str) -> str:
        given = image.path.stem if image.path else image.gltf.get("image", {}).get("name", "")
        return re.sub(r"[^\w.-]+", "_", str(given)) or slot

    def _stored(self, data: bytes, base: str, suffix: str) -> str:
        if data not in self._named:
            name = self._side_names.new(f"{self.stem}_{base}", suffix, [data])
            self.files[name] = data
            self._named[data] = name
        return self._named[data]

    def _say(self, what: str) -> None:
        if what not in self.lost:
            self.lost.append(what)


def _transform(info: dict[str, Any]) -> dict[str, Any]:
    return (info.get("extensions") or {}).get("KHR_texture_transform") or {}


def _is_turned(info: dict[str, Any], image: TextureImage) -> bool:
    """Whether v count from the image's bottom, as they do in files that were made of an OBJ."""
    default = (1, -1) if image.bottom_up else (1, 1)
    return bool(_transform(info).get("scale", default)[1] < 0)
