"""Textures of OBJ's materials in the slots that glTF has: a mask as the alpha of the base colour,
roughness and metalness as two channels of one image."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.geometry.mesh import Material
from umbel.io.gltf.textures import FLIPPED
from umbel.io.textures.images import TextureImage

_SLOTS = ("alpha", "roughness", "metallic", "specular")
_NEAR = 32
"""Alpha of a cut-out mask is nearly all no farther from nothing and from everything."""
_CUT_OUT = 0.9

Texels = NDArray[np.uint8]


Made = dict[Any, Any]
"""Images that were made of others, by these."""


def packed(material: Material, made: Made | None = None) -> tuple[Material, list[str]]:
    """The material with textures in glTF's slots alone, and what these cannot hold. `made`: for
    further materials, which may have the same textures."""
    if not any(slot in material.images for slot in _SLOTS):
        return material, []
    made = {} if made is None else made
    images, textures = dict(material.images), dict(material.textures)
    given = {slot: images.pop(slot, None) for slot in _SLOTS}
    for slot in _SLOTS:
        textures.pop(slot, None)
    out = replace(material, images=images, textures=textures)
    lost: list[str] = []
    if given["specular"] is not None:
        lost.append(f"the specular texture of {material.name!r}")
    for slot, other in (("alpha", "base_color"), ("metallic", "roughness")):  # in one image
        both = slot in material.images and other in material.images
        if both and _place(material, slot) != _place(material, other):
            what = f"the {slot} texture of {material.name!r}"
            lost.append(f"{what}, which lies otherwise than the {other} one")
            given[slot] = None
    try:
        if given["alpha"] is not None:
            _add_mask(out, given["alpha"], material.textures.get("alpha", {}), made)
    except Error as error:
        lost.append(str(error))
    try:
        if given["roughness"] is not None or given["metallic"] is not None:
            _add_metal(out, material, given["roughness"], given["metallic"], made)
    except Error as error:
        lost.append(str(error))
    return out, lost


def _place(material: Material, slot: str) -> Any:
    """How texture coordinates address the image of a slot."""
    image = material.images[slot]
    extensions = material.textures.get(slot, {}).get("extensions") or {}
    moved = extensions.get("KHR_texture_transform", FLIPPED if image.bottom_up else None)
    return moved, image.wrap_u, image.wrap_v


def _add_mask(material: Material, mask: TextureImage, info: dict[str, Any], made: Made) -> None:
    key = "mask", material.images.get("base_color"), mask
    if key not in made:
        made[key] = _masked(*key[1:])
    material.images["base_color"], mode = made[key]
    material.textures.setdefault("base_color", info)
    if material.alpha_mode == "OPAQUE":
        material.alpha_mode = mode


def _masked(base: TextureImage | None, mask: TextureImage) -> tuple[TextureImage, str]:
    """An image with a mask as its alpha, and how that is blended."""
    texels = mask.texels()
    if base is not None and (base.path, base.data) == (mask.path, mask.data):
        alpha, image = texels[..., 3], base
    else:
        alpha = texels[..., 3] if int(texels[..., 3].min()) < 255 else texels[..., 0]
        size = alpha.shape if base is None else np.maximum(alpha.shape, base.texels().shape[:2])
        color = np.full((*size, 3), 255, np.uint8)
        if base is not None:
            color = _sized(base.texels(), tuple(size))[..., :3]
        image = _png(np.dstack([color, _sized(alpha, tuple(size))]), base or mask)
    if int(alpha.min()) == 255:
        return image, "OPAQUE"
    clear = ((alpha < _NEAR) | (alpha > 255 - _NEAR)).mean()
    return image, "MASK" if clear > _CUT_OUT else "BLEND"


def _add_metal(
    out: Material,
    material: Material,
    rough: TextureImage | None,
    metal: TextureImage | None,
    made: Made,
) -> None:
    """In OBJ a map replaces the factor, in glTF they are multiplied."""
    key = "metal", rough, metal
    if key not in made:
        made[key] = _rough_metal(rough, metal)
    out.roughness = material.roughness if rough is None else 1.0
    out.metallic = material.metallic if metal is None else 1.0
    out.images["metallic_roughness"] = made[key]
    slot = "metallic" if rough is None else "roughness"
    out.textures["metallic_roughness"] = material.textures.get(slot, {})


def _rough_metal(rough: TextureImage | None, metal: TextureImage | None) -> TextureImage:
    """The channels of both images in one."""
    planes = [None if image is None else image.texels()[..., 0] for image in (rough, metal)]
    size = np.max([plane.shape for plane in planes if plane is not None], axis=0)
    texels = np.full((*size, 3), 255, np.uint8)
    for channel, plane in enumerate(planes):
        if plane is not None:
            texels[..., channel + 1] = _sized(plane, tuple(size))
    image = rough or metal
    assert image is not None
    return _png(texels, image)


def _sized(texels: Texels, size: tuple[int, ...]) -> Texels:
    if texels.shape[:2] == size:
        return texels
    from PIL import Image

    resized = Image.fromarray(np.ascontiguousarray(texels)).resize((size[1], size[0]))
    return np.asarray(resized, np.uint8)


def _png(texels: Texels, like: TextureImage) -> TextureImage:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(texels)).save(out, "PNG")
    return replace(like, data=out.getvalue(), path=None)
