"""Material libraries of OBJ: colours, the usual physically based additions, names of maps."""

from __future__ import annotations

import re
import warnings
from typing import Any

from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Material
from umbel.io.folder import Folder
from umbel.io.textures.images import TextureImage

_MAPS = {
    "map_kd": "base_color", "map_bump": "normal", "bump": "normal", "norm": "normal",
    "map_ke": "emissive", "map_d": "alpha", "map_pr": "roughness", "map_pm": "metallic",
    "map_ks": "specular",
}  # fmt: skip
#: Options of maps with one word, and those with up to three numbers or two.
_WORDS = ("-blendu", "-blendv", "-boost", "-texres", "-clamp", "-bm", "-imfchan", "-type", "-cc",
          "-colorspace")  # fmt: skip
_NUMBERS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2}


def read_mtl(data: bytes, folder: Folder | None = None, where: str = "") -> dict[str, Material]:
    """The materials of a library by name; what makes no sense in it is stepped over. Images are
    files in `folder`. `where` names the library in warnings."""
    found: dict[str, Material] = {}
    current = _Statements(Material(), folder, where)
    for raw in _lines(data):
        words = raw.split("#", 1)[0].split() if "#" in raw else raw.split()
        if len(words) < 2:
            continue
        if words[0].lower() == "newmtl":
            current = _Statements(Material(name=raw.split(None, 1)[1].strip()), folder, where)
            found[current.material.name] = current.material
        else:
            current.take(words[0].lower(), words[1:], raw)
    return found


def _lines(data: bytes) -> list[str]:
    text = data.decode("utf-8-sig", "replace")
    return re.sub(r"\\[ \t]*\r?\n", " ", text).splitlines()


class _Statements:
    """One material, as the lines after `newmtl` make it."""

    def __init__(self, material: Material, folder: Folder | None, where: str) -> None:
        self.material = material
        self._folder, self._where = folder, where
        self._has_roughness = False  # of its own: then the exponent does not count

    def take(self, key: str, words: list[str], line: str) -> None:
        material, values = self.material, _some_floats(words)
        if key in _MAPS:
            self._map(_MAPS[key], words, line)
        elif not values:
            return
        elif key in ("kd", "ke"):
            r, g, b = (values * 3)[:3] if len(values) < 3 else values[:3]
            if key == "kd":
                material.base_color = (r, g, b, material.base_color[3])
            else:
                material.emissive = (r, g, b)
        elif key in ("d", "tr"):
            alpha = values[-1] if key == "d" else 1.0 - values[0]
            material.base_color = (*material.base_color[:3], alpha)
            material.alpha_mode = "BLEND" if alpha < 1.0 else "OPAQUE"
        elif key == "pm":
            material.metallic = values[0]
        elif key == "pr":
            material.roughness, self._has_roughness = values[0], True
        elif key == "ns" and not self._has_roughness:
            # Blinn-Phong exponent to roughness (Karis 2013)
            material.roughness = min(1.0, (2.0 / (max(values[0], 0.0) + 2.0)) ** 0.25)
        elif key in ("pc", "pcr"):
            coat = material.extensions.setdefault("KHR_materials_clearcoat", {})
            coat["clearcoatFactor" if key == "pc" else "clearcoatRoughnessFactor"] = values[0]

    def _map(self, slot: str, words: list[str], line: str) -> None:
        options, name = _options(words)
        info: dict[str, Any] = {"uri": name, "line": line.strip()}
        if slot == "normal" and "-bm" in options:
            info["scale"] = float(_some_floats(options["-bm"])[0])
        moved = _transform(options)
        if moved:
            info["extensions"] = {"KHR_texture_transform": moved}
        self.material.textures[slot] = info
        self.material.images.pop(slot, None)
        if self._folder is None:
            return
        wrap = "clamp" if options.get("-clamp") == ["on"] else "repeat"
        try:
            path = self._folder.find(name, may_miss=True)
        except Error as error:
            what = f"{self._where}: material {self.material.name!r} loses its {slot} texture"
            warnings.warn(f"{what}: {error}", LoadWarning, stacklevel=7)
            return
        self.material.images[slot] = TextureImage(
            path=path, wrap_u=wrap, wrap_v=wrap, bottom_up=not moved
        )


def _options(words: list[str]) -> tuple[dict[str, list[str]], str]:
    """A map's options, and the name of its file, which may have blanks."""
    options: dict[str, list[str]] = {}
    at = 0
    while at < len(words) - 1:
        key = words[at].lower()
        if key in _WORDS:
            count = 1
        elif key in _NUMBERS:
            most = words[at + 1 : min(at + 1 + _NUMBERS[key], len(words) - 1)]
            count = len(_some_floats(most))
        else:
            break
        options[key] = words[at + 1 : at + 1 + count]
        at += 1 + count
    return options, " ".join(words[at:])


def _transform(options: dict[str, list[str]]) -> dict[str, list[float]]:
    """KHR_texture_transform of -o and -s: of coordinates whose v = 0 is the image's bottom, as in
    OBJ, to those whose v = 0 is its top."""
    if "-o" not in options and "-s" not in options:
        return {}
    offset = [*_some_floats(options.get("-o", [])), 0.0, 0.0][:2]
    scale = _some_floats(options.get("-s", []))
    scale = [*scale, 1.0, 1.0][:2]
    return {"offset": [offset[0], 1.0 - offset[1]], "scale": [scale[0], -scale[1]]}


def _some_floats(words: list[str]) -> list[float]:
    out = []
    for word in words:
        try:
            out.append(float(word))
        except ValueError:
            break
    return out


def unique_names(materials: list[Material]) -> list[str]:
    """A name without white space for each, no two alike."""
    names: list[str] = []
    seen: set[str] = set()
    for k, material in enumerate(materials):
        name = re.sub(r"\s+", "_", material.name.strip()) or f"material_{k}"
        while name in seen:
            name = f"{name}_{k}"
        seen.add(name)
        names.append(name)
    return names
