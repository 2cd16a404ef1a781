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
_VALUES = {"kd", "ke", "d", "tr", "pm", "pr", "ns", "pc", "pcr", "ni"}
#: Of lights and rules of shading that no material here has: nearly every library has them.
_IDLE = {"ka", "illum"}
_ANY_MAP = ("map_", "bump", "norm", "disp", "decal", "refl")
#: Options of maps with one word, and those with up to three numbers or two.
_WORDS = ("-blendu", "-blendv", "-boost", "-texres", "-clamp", "-bm", "-imfchan", "-type", "-cc",
          "-colorspace")  # fmt: skip
_NUMBERS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2}
_READ_OPTIONS = ("-o", "-s", "-clamp")
#: A comment, which is no part of a name that has the sign inside.
_COMMENT = re.compile(r"(?:^|(?<=\s))#.*")
_SHOWN = 8  # statements in a warning


def read_mtl(data: bytes, folder: Folder | None = None, where: str = "") -> dict[str, Material]:
    """The materials of a library by name; one warning names the statements that are left out.
    Images are files in `folder`. `where` names the library in warnings."""
    found: dict[str, Material] = {}
    current = _Statements(Material(), folder, where)
    lost: dict[str, None] = {}
    for raw in _lines(data):
        words = raw.split()
        if len(words) < 2:
            continue
        if words[0].lower() == "newmtl":
            current = _Statements(Material(name=raw.split(None, 1)[1].strip()), folder, where)
            found[current.material.name] = current.material
        else:
            lost.update(dict.fromkeys(current.take(words[0], words[1:], raw)))
    if lost:
        more = [f"and {len(lost) - _SHOWN} more"] if len(lost) > _SHOWN else []
        sentence = f"{where}: left out: {', '.join([*list(lost)[:_SHOWN], *more])}"
        warnings.warn(sentence, LoadWarning, stacklevel=7)
    return found


def map_names(data: bytes) -> list[str]:
    """The files of all maps of a library."""
    every = (line.split() for line in _lines(data))
    maps = (words for words in every if len(words) > 1 and words[0].lower().startswith(_ANY_MAP))
    return [_options(words[1:])[1] for words in maps]


def _lines(data: bytes) -> list[str]:
    """The lines without comments."""
    text = re.sub(r"\\[ \t]*\r?\n", " ", data.decode("utf-8-sig", "replace"))
    return [_COMMENT.sub("", line) if "#" in line else line for line in text.splitlines()]


class _Statements:
    """One material, as the lines after `newmtl` make it."""

    def __init__(self, material: Material, folder: Folder | None, where: str) -> None:
        self.material = material
        self._folder, self._where = folder, where
        self._has_roughness = False  # of its own: then the exponent does not count

    def take(self, word: str, words: list[str], line: str) -> list[str]:
        """Takes a statement, and gives what of it is left out."""
        key, material = word.lower(), self.material
        if key == "d" and words[0] == "-halo":
            return [*self.take(word, words[1:], line), "d -halo"]
        values = _some_floats(words)
        if key in _MAPS:
            return self._map(_MAPS[key], word, words, line)
        if key in _IDLE or (key == "ks" and values and max(values) == min(values) <= 0.5):
            return []  # gloss as it is without the statement, or less
        if key not in _VALUES or not values:
            return [" ".join([word, *words[:1]]) if key in _VALUES else word]
        if key in ("kd", "ke"):
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
        elif key == "ni" and values[0] > 1 and values[0] != 1.5:  # 1.5 is as without it
            material.extensions["KHR_materials_ior"] = {"ior": values[0]}
        return []

    def _map(self, slot: str, word: str, words: list[str], line: str) -> list[str]:
        options, name = _options(words)
        read = (*_READ_OPTIONS, "-bm") if slot == "normal" else _READ_OPTIONS
        lost = [f"{word} {option}" for option in options if option not in read]
        info: dict[str, Any] = {"uri": name, "line": line.strip()}
        if slot == "normal" and "-bm" in options:
            info["scale"] = float(_some_floats(options["-bm"])[0])
        moved = _transform(options)
        if moved:
            info["extensions"] = {"KHR_texture_transform": moved}
        self.material.textures[slot] = info
        self.material.images.pop(slot, None)
        if self._folder is None:
            return lost
        wrap = "clamp" if options.get("-clamp") == ["on"] else "repeat"
        try:
            path = self._folder.find(name, may_miss=True)
        except Error as error:
            what = f"{self._where}: material {self.material.name!r} loses its {slot} texture"
            warnings.warn(f"{what}: {error}", LoadWarning, stacklevel=8)
            return lost
        self.material.images[slot] = TextureImage(
            path=path, wrap_u=wrap, wrap_v=wrap, bottom_up=not moved
        )
        return lost


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
    name = " ".join(words[at:])
    quoted = len(name) > 2 and name[0] == name[-1] == '"'
    return options, name[1:-1] if quoted else name


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
    """A name that is one word and no comment for each, no two alike."""
    names: list[str] = []
    seen: set[str] = set()
    for k, material in enumerate(materials):
        name = re.sub(r"\s+|^#", "_", material.name.strip()) or f"material_{k}"
        while name in seen:
            name = f"{name}_{k}"
        seen.add(name)
        names.append(name)
    return names
