"""Material libraries of OBJ: colours, the usual physically based additions, names of maps."""

from __future__ import annotations

import re
from pathlib import Path

from umbel.io.images import TextureImage, beside
from umbel.mesh import Material

_MAPS = {
    "map_kd": "base_color", "map_bump": "normal", "bump": "normal", "norm": "normal",
    "map_ke": "emissive", "map_d": "alpha", "map_pr": "roughness", "map_pm": "metallic",
    "map_ks": "specular",
}  # fmt: skip


def read_mtl(data: bytes, folder: Path | None = None) -> dict[str, Material]:
    """The materials of a library by name; what makes no sense in it is stepped over. Images are
    those of files below `folder`."""
    found: dict[str, Material] = {}
    current = Material()
    for raw in data.decode("utf-8", "replace").splitlines():
        words = raw.split("#", 1)[0].split() if "#" in raw else raw.split()
        if len(words) < 2:
            continue
        key, values = words[0].lower(), _some_floats(words[1:])
        r, g, b, a = current.base_color
        if key == "newmtl":
            current = Material(name=raw.split(None, 1)[1].strip())
            found[current.name] = current
        elif key == "kd" and values:
            r, g, b = (values * 3)[:3] if len(values) < 3 else values[:3]
            current.base_color = (r, g, b, a)
        elif key == "ke" and values:
            r, g, b = (values * 3)[:3] if len(values) < 3 else values[:3]
            current.emissive = (r, g, b)
        elif key in ("d", "tr") and values:
            alpha = values[-1] if key == "d" else 1.0 - values[0]
            current.base_color = (r, g, b, alpha)
            current.alpha_mode = "BLEND" if alpha < 1.0 else "OPAQUE"
        elif key == "pm" and values:
            current.metallic = values[0]
        elif key == "pr" and values:
            current.roughness = values[0]
        elif key == "ns" and values:  # Blinn-Phong exponent to roughness (Karis 2013)
            current.roughness = min(1.0, (2.0 / (max(values[0], 0.0) + 2.0)) ** 0.25)
        elif key in _MAPS:
            current.textures[_MAPS[key]] = {"uri": words[-1], "line": raw.strip()}
            path = beside(folder, words[-1])
            if path is not None:
                current.images[_MAPS[key]] = TextureImage(path=path, bottom_up=True)
    return found


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


def mtl_text(materials: list[Material], names: list[str]) -> str:
    """The library that `read_mtl` reads."""
    out = []
    for material, name in zip(materials, names, strict=True):
        r, g, b, a = material.base_color
        out.append(
            f"newmtl {name}\nKd {r:.9g} {g:.9g} {b:.9g}\nd {a:.9g}\n"
            "Ke {:.9g} {:.9g} {:.9g}\n".format(*material.emissive)
            + f"Pm {material.metallic:.9g}\nPr {material.roughness:.9g}\n"
        )
    return "\n".join(out)
