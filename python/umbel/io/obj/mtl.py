"""Material libraries of OBJ: colours, the usual physically based additions, names of maps."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Material
from umbel.io.files import BOM, text_of
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
#: Options of maps with one word, and the most numbers of the others.
_WORDS = ("-blendu", "-blendv", "-boost", "-texres", "-clamp", "-imfchan", "-type", "-cc",
          "-colorspace")  # fmt: skip
#: How far apart the channels of a grey image are, on average, at most. Of a map of normals, whose
#: blue is more than a half, they are farther.
_GREY = 16
_LOOKED_AT = 256  # texels a side
_NUMBERS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2, "-bm": 1}
_READ_OPTIONS = ("-o", "-s", "-clamp")
#: What is between words. Names may have other white space.
_BLANKS = " \t\v\f"
_WORD = re.compile(rf"[^{_BLANKS}]+")
_STATEMENT = re.compile(rf"[{_BLANKS}]*([^{_BLANKS}]+)(?:[{_BLANKS}]+([^{_BLANKS}].*))?")
_LINE_END = re.compile(r"\r\n?|\n")
_CONTINUED = re.compile(rf"\\[{_BLANKS}]*(?:{_LINE_END.pattern})")
#: A comment, which is no part of a name that has the sign inside.
_COMMENT = re.compile(rf"(?:^|(?<=[{_BLANKS}]))#.*")
_SHOWN = 8  # statements in a warning


def read_mtl(data: bytes, folder: Folder | None = None, where: str = "") -> dict[str, Material]:
    """The materials of a library by name, as `as_name` has it; one warning names the statements
    that are left out. Images are files in `folder`. `where` names the library in warnings."""
    found: dict[str, Material] = {}
    current: _Statements | None = None
    grey: dict[str, bool] = {}
    outside: list[str] = []
    lost: dict[str, None] = {}
    for word, rest in _statements(data):
        if word.lower() == "newmtl":
            if rest in found:
                lost[f"all but the last material {shown_name(rest)!r}"] = None
            current = _Statements(Material(name=shown_name(rest)), folder, outside, grey)
            found[rest] = current.material
        else:
            lost.update(dict.fromkeys(current.take(word, rest) if current else [word]))
    if outside:
        others = f"; and {len(outside) - 1} more" if len(outside) > 1 else ""
        warnings.warn(f"{where}: {text_of(outside[0])}{others}", LoadWarning, stacklevel=7)
    if lost:
        more = [f"and {len(lost) - _SHOWN} more"] if len(lost) > _SHOWN else []
        left_out = text_of(", ".join([*list(lost)[:_SHOWN], *more]))
        warnings.warn(f"{where}: left out: {left_out}", LoadWarning, stacklevel=7)
    return found


def map_names(data: bytes) -> list[str]:
    """The files of all maps of a library."""
    every = _statements(data)
    return [_options(rest)[1] for word, rest in every if word.lower().startswith(_ANY_MAP)]


def as_name(raw: bytes) -> str:
    """A name, or a text with names, that keeps its bytes where they are no UTF-8, so that names are
    equal if their bytes are, and files are found."""
    return raw.decode("utf-8", "surrogateescape")


def shown_name(name: str) -> str:
    """The name as a text that can be stored: read as Latin-1 where it is no UTF-8."""
    raw = name.encode("utf-8", "surrogateescape")
    try:
        return raw.decode()
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def words_of(text: str) -> list[str]:
    """The words between blanks."""
    return _WORD.findall(text)


def _statements(data: bytes) -> Iterator[tuple[str, str]]:
    """The first word of each line and what follows it, without comments. Only a material may lack
    what follows: its name."""
    text = _CONTINUED.sub(" ", as_name(data.removeprefix(BOM)))
    for line in _LINE_END.split(text):
        found = _STATEMENT.match(_COMMENT.sub("", line) if "#" in line else line)
        if found and (found[2] or found[1].lower() == "newmtl"):
            yield found[1], (found[2] or "").rstrip(_BLANKS)


class _Statements:
    """One material, as the lines after `newmtl` make it."""

    def __init__(
        self,
        material: Material,
        folder: Folder | None,
        outside: list[str],
        grey: dict[str, bool],
    ) -> None:
        self.material = material
        self._folder = folder
        self._outside = outside  # sentences on textures that are not looked for
        self._grey = grey  # which images are, of those that were looked at
        self._has_roughness = False  # of its own: then the exponent does not count
        self._has_opacity = False  # of its own: then transparency does not count
        self._transparency = ""  # the statement, if there is one
        self._has_emission = False  # of its own: then a map of it is multiplied by that

    def take(self, word: str, rest: str) -> list[str]:
        """Takes a statement, and gives what of it is left out."""
        key, material = word.lower(), self.material
        if key in _MAPS:
            return self._map(_MAPS[key], word, rest)
        words = words_of(rest)
        if key == "d" and words[:1] == ["-halo"]:
            return [*self.take(word, " ".join(words[1:])), "d -halo"]
        values = _some_floats(words)
        if not np.isfinite(values).all():
            return [" ".join([word, *words[:1]])]
        if key in _IDLE or (key == "ks" and values and max(values) == min(values) <= 0.5):
            return []  # gloss as it is without the statement, or less
        if key not in _VALUES or not values:
            return [" ".join([word, *words[:1]]) if key in _VALUES else word]
        if key in ("kd", "ke"):
            r, g, b = (values * 3)[:3] if len(values) < 3 else values[:3]
            if key == "kd":
                material.base_color = (r, g, b, material.base_color[3])
            else:
                material.emissive, self._has_emission = (r, g, b), True
        elif key in ("d", "tr"):
            alpha = values[-1] if key == "d" else 1.0 - values[0]
            same = abs(alpha - material.base_color[3]) < 1e-3
            statement = " ".join([word, *words[:1]])
            if key == "tr" and self._has_opacity:  # some programs mean opacity by it
                return [] if same else [statement]
            lost = [self._transparency] if self._transparency and not same else []
            self._transparency = statement if key == "tr" else ""
            self._has_opacity |= key == "d"
            material.base_color = (*material.base_color[:3], alpha)
            material.alpha_mode = "BLEND" if alpha < 1.0 else "OPAQUE"
            return lost
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

    def _map(self, slot: str, word: str, rest: str) -> list[str]:
        options, name = _options(rest)
        if slot == "normal" and word.lower() != "norm" and self._has_heights(name):
            return [f"{word} with a map of heights"]
        read = (*_READ_OPTIONS, "-bm") if slot == "normal" else _READ_OPTIONS
        lost = [f"{word} {key}" for key, values in options.items() if key not in read or not values]
        info: dict[str, Any] = {"uri": shown_name(name), "line": shown_name(f"{word} {rest}")}
        if slot == "normal" and options.get("-bm"):
            info["scale"] = float(options["-bm"][0])
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
            what = f"material {self.material.name!r} loses its {slot} texture"
            self._outside.append(f"{what}: {error}")
            return lost
        self.material.images[slot] = TextureImage(
            path=path, wrap_u=wrap, wrap_v=wrap, bottom_up=not moved
        )
        if slot == "emissive" and not self._has_emission and os.path.isfile(path):
            self.material.emissive = (1.0, 1.0, 1.0)
        return lost

    def _has_heights(self, name: str) -> bool:
        """Whether an image is grey, as maps of heights are, which `bump` is in OBJ."""
        if self._folder is None:
            return False
        if name not in self._grey:
            try:
                self._grey[name] = _is_grey(TextureImage(path=self._folder.find(name)).texels())
            except Error:
                self._grey[name] = False
        return self._grey[name]


def _is_grey(texels: NDArray[np.uint8]) -> bool:
    height, width = (max(1, size // _LOOKED_AT) for size in texels.shape[:2])
    colors = texels[::height, ::width, :3].astype(np.int16)
    return bool(np.ptp(colors, axis=2).mean() <= _GREY)


def _options(rest: str) -> tuple[dict[str, list[str]], str]:
    """A map's options, and the name of its file, which may have blanks. An option lacks its values
    where the file or another word stands in their place."""
    options: dict[str, list[str]] = {}
    found = list(_WORD.finditer(rest))
    words = [word.group() for word in found]
    at = 0
    while at < len(words) - 1:
        key = words[at].lower()
        values = words[at + 1 : min(at + 1 + _NUMBERS.get(key, 1), len(words) - 1)]
        if key in _NUMBERS:
            values = values[: len(_some_floats(values))]
            if not np.isfinite(_some_floats(values)).all():
                at += len(values)
                values = []
        elif key not in _WORDS:
            break
        options[key] = values
        at += 1 + len(values)
    name = rest[found[at].start() :] if found else ""
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
    """A name that is one word of a line, and no comment, for each, no two alike."""
    names: list[str] = []
    seen: set[str] = set()
    for k, material in enumerate(materials):
        # A backslash at the end would take the next line to this one.
        name = re.sub(r"\s+|^#|\\$", "_", text_of(material.name).strip()) or f"material_{k}"
        while name in seen:
            name = f"{name}_{k}"
        seen.add(name)
        names.append(name)
    return names
