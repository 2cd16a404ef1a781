"""Materials, textures and light as the path tracer takes them."""

from __future__ import annotations

import fnmatch
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Material, Mesh
from umbel.io.textures.images import TextureImage
from umbel.io.textures.packed import Made, packed
from umbel.trace.shading_layers import NO_TEXTURE, SRGB_TEXTURES, Use, add_layers, not_rendered

#: Up, and the front from which azimuths count: glTF's and OBJ's axes, and those of CAD and maps.
AXES = {"y": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), "z": ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0))}

#: The longest side of a texture that the tracer takes.
_LONGEST = 65_536

#: Slots whose colours are sRGB-encoded.
_SRGB = ("base_color", "emissive", *SRGB_TEXTURES)


@dataclass(frozen=True)
class Environment:
    """The light around a mesh: a clear sky with a sun (Preetham, Shirley & Smits 1999), or one
    colour from everywhere.

    Angles are in degrees; azimuths count from the front (+Z where Y is up) to the right."""

    sun_azimuth: float = 80.0
    sun_elevation: float = 48.0  #: lifted to 3 where lower
    sun_size: float = 0.53  #: radius of the disc, 0.06 to 28; the real one is 0.27
    sun: float = 1.0  #: strength, times the model's
    sky: float = 1.0  #: strength, times the model's
    turbidity: float = 2.0  #: haze, 1.7 to 10
    ground: Sequence[float] = (0.3, 0.29, 0.27)  #: albedo below the horizon
    color: Sequence[float] | None = None  #: radiance from everywhere instead of sky and sun

    def native(self, up: str) -> _umbel.TraceEnvironment:
        """For the tracer, with the axis that points up."""
        zenith, front = (np.array(axis) for axis in axes_of(up))
        azimuth, elevation = (
            math.radians(self._number(name)) for name in ("sun_azimuth", "sun_elevation")
        )
        size = math.radians(self._number("sun_size"))
        if not 0.001 <= size <= 0.5:
            raise Error(
                f"environment.sun_size must be from 0.06 to 28 degrees, not {self.sun_size}"
            )
        level = front * math.cos(azimuth) + np.cross(zenith, front) * math.sin(azimuth)
        sun = level * math.cos(elevation) + zenith * math.sin(elevation)
        out = _umbel.TraceEnvironment()
        out.up = triple(zenith, "up")
        out.sun_direction = triple(sun, "the sun's angles")
        out.sun_radius = size
        out.sun_strength, out.sky_strength = self._number("sun"), self._number("sky")
        out.turbidity = self._number("turbidity")
        out.ground_albedo = triple(self.ground, "ground")
        if self.color is not None:
            out.constant = True
            out.color = triple(self.color, "color")
        return out

    def _number(self, name: str) -> float:
        value = getattr(self, name)
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if not math.isfinite(number):
            raise Error(f"environment.{name} must be a number, not {value!r}")
        return number


def axes_of(up: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Up and front for the name of an axis."""
    if up not in AXES:
        raise Error(f"up must be {' or '.join(map(repr, AXES))}, not {up!r}")
    return AXES[up]


def triple(values: Any, what: str) -> tuple[float, float, float]:
    """Three numbers."""
    try:
        x, y, z = (float(v) for v in values)
    except (TypeError, ValueError):
        raise Error(f"{what} must be three numbers, not {values!r}") from None
    return x, y, z


def matching(materials: Sequence[Material], patterns: Sequence[str]) -> list[int]:
    """The materials whose names match (`*` and `?` as in shells). Raises for a pattern that matches
    none."""
    patterns = [patterns] if isinstance(patterns, str) else patterns
    names = [material.name for material in materials]
    hidden: set[int] = set()
    for pattern in patterns:
        literal = pattern.replace("[", "[[]")
        found = [k for k, name in enumerate(names) if fnmatch.fnmatchcase(name, literal)]
        if not found:
            known = ", ".join(sorted(set(names))) or "none"
            raise Error(f"no material is named {pattern!r}; there are {known}")
        hidden.update(found)
    return sorted(hidden)


def without(mesh: Mesh, patterns: Sequence[str]) -> Mesh:
    """The mesh without the triangles of materials whose names match."""
    hidden = matching(mesh.materials, patterns)
    if not hidden or mesh.material_ids is None:
        return mesh
    kept = ~np.isin(mesh.material_ids, hidden)
    return replace(mesh, triangles=mesh.triangles[kept], material_ids=mesh.material_ids[kept])


class Shading:
    """A mesh's materials and their textures, made native; a texture that several materials
    use in the same way is decoded once."""

    def __init__(self, mesh: Mesh, warn: bool = True) -> None:
        self.materials: list[_umbel.TraceMaterial] = []
        self.textures: list[_umbel.TraceTexture] = []
        self._indices: dict[tuple[Any, ...], int] = {}
        self._images: list[TextureImage] = []  # keeps the ids in use
        self._warn = warn
        self._uv_sets = 0 if mesh.uvs is None else 1 + len(mesh.uv_sets)
        if mesh.material_ids is None:
            return  # the tracer's own plain material
        made: Made = {}
        for given in mesh.materials:
            material, lost = packed(given, made)
            self.materials.append(self._material(material))
            for what in lost:
                self._say(f"not rendered: {what}")
        for sentence in not_rendered(mesh.materials):
            self._say(sentence)

    def _material(self, material: Material) -> _umbel.TraceMaterial:
        if replace(material, name="", extras=None) == Material():
            return plain()  # the file says nothing: no white that never gets dark
        out = _umbel.TraceMaterial()
        r, g, b, alpha = (_unit(v) for v in material.base_color)
        out.base_color, out.alpha = (r, g, b), alpha
        out.metallic, out.roughness = _unit(material.metallic), _unit(material.roughness)
        out.emission = triple(material.emissive, f"the emission of {material.name!r}")
        out.alpha_cutoff = max(material.alpha_cutoff, 0.0)
        modes = {"MASK": _umbel.TraceAlpha.mask, "BLEND": _umbel.TraceAlpha.blend}
        out.alpha_mode = modes.get(material.alpha_mode, _umbel.TraceAlpha.opaque)
        out.base_color_texture = self._use(material, "base_color")
        out.metallic_roughness_texture = self._use(material, "metallic_roughness")
        out.normal_texture = self._use(material, "normal")
        out.normal_scale = _number(material.textures.get("normal", {}).get("scale", 1.0))
        if any(material.emissive):
            out.emission_texture = self._use(material, "emissive")
        add_layers(material, out, lambda slot: self._use(material, slot))
        return out

    def _use(self, material: Material, slot: str) -> Use:
        image = material.images.get(slot)
        if image is None and slot in material.textures:
            self._say(f"material {material.name!r} loses its {slot} texture: there is no image")
        if image is None:
            return NO_TEXTURE
        info = material.textures.get(slot, {})
        uv_set = uv_set_of(material, slot)
        if not 0 <= uv_set < self._uv_sets:
            self._say(
                f"the {slot} texture of material {material.name!r} uses the texture coordinates "
                f"{_uv_set_named(info)!r}, which the mesh does not have, and is left out"
            )
            return NO_TEXTURE
        index = self._texture(image, slot.rpartition("/")[2] in _SRGB, material.name)
        if index < 0:
            return NO_TEXTURE
        if image.bottom_up:
            return index, 0.0, 1.0, 1.0, -1.0, 0.0, uv_set
        moved = _transform(info)
        try:
            u, v = (float(x) for x in moved.get("offset", (0, 0)))
            su, sv = (float(x) for x in moved.get("scale", (1, 1)))
            return index, u, v, su, sv, float(moved.get("rotation", 0)), uv_set
        except (TypeError, ValueError):
            self._say(f"material {material.name!r}: no numbers transform its {slot} texture")
            return index, 0.0, 0.0, 1.0, 1.0, 0.0, uv_set

    def _texture(self, image: TextureImage, srgb: bool, name: str) -> int:
        source = image.path if image.data is None else id(image.data)
        key = (source, srgb, image.nearest, image.wrap_u, image.wrap_v)
        if key not in self._indices:
            self._images.append(image)
            try:
                texels = image.texels()
            except Error as error:
                self._say(f"material {name!r} loses a texture: {error}")
                self._indices[key] = -1
                return -1
            height, width = texels.shape[:2]
            if max(width, height) > _LONGEST:
                texels = _fitted(texels, image.nearest)
                self._say(
                    f"material {name!r} gets a texture of {width} x {height} texels at "
                    f"{texels.shape[1]} x {texels.shape[0]}"
                )
            wrap = [getattr(_umbel.TraceWrap, w) for w in (image.wrap_u, image.wrap_v)]
            self._indices[key] = len(self.textures)
            self.textures.append(_umbel.TraceTexture(texels, srgb, image.nearest, *wrap))
        return self._indices[key]

    def _say(self, sentence: str) -> None:
        if self._warn:
            warnings.warn(sentence, LoadWarning, stacklevel=2)


def _fitted(texels: NDArray[np.uint8], nearest: bool) -> NDArray[np.uint8]:
    """With sides that are short enough. Each channel by itself: alpha hides no colours here."""
    from PIL import Image

    height, width = (min(side, _LONGEST) for side in texels.shape[:2])
    method = Image.Resampling.NEAREST if nearest else Image.Resampling.BOX
    bands = [
        np.asarray(Image.fromarray(np.ascontiguousarray(band)).resize((width, height), method))
        for band in np.moveaxis(texels, -1, 0)
    ]
    return np.stack(bands, axis=-1)


def plain(albedo: float = 0.75) -> _umbel.TraceMaterial:
    """Lambert's grey, for what nothing is known of."""
    out = _umbel.TraceMaterial()
    out.base_color = (albedo, albedo, albedo)
    out.specular = 0.0
    return out


def uv_set_of(material: Material, slot: str) -> int:
    """Which texture coordinates a texture uses; -1 where what the file says is no number."""
    named = _uv_set_named(material.textures.get(slot, {}))
    return named if isinstance(named, int) else -1


def _uv_set_named(info: dict[str, Any]) -> Any:
    return _transform(info).get("texCoord", info.get("texCoord", 0))


def _transform(info: dict[str, Any]) -> dict[str, Any]:
    return _object(_object(info.get("extensions")).get("KHR_texture_transform"))


def _object(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) else 1.0


def _unit(value: float) -> float:
    """Rounding of a file's writer is not its reader's fault; NaN stays for the tracer to name."""
    return float(np.clip(value, 0.0, 1.0))
