"""Smaller copies of an asset's images, so that a first picture need not wait for the large ones."""

from __future__ import annotations

import io
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.io.textures.images import decode, mime_type

Json = dict[str, Any]

SIDES = (256, 1024)
"""The longest side of each copy. An image gets those that are at most half as large as it is."""
_LEAST_BYTES = 32 << 10
"""Files up to this size get no copies: they are as soon there as one."""
_SHARE = 0.15
"""Most bytes of an image's copies together, beside its own; the smallest may take more."""
_SMALLEST_SHARE = 0.5
_COLORS = {"base_color", "emissive"}

Level = tuple[int, int, bytes]


def add_levels(
    images: list[Json], files: list[bytes], slots: list[set[str]], threads: int = 0
) -> list[bytes]:
    """Gives each of the images that are large its `width`, `height` and `levels`. Returns all
    files: the copies, smallest sides first, and then those there are; images get new numbers.

    slots: what each file is used for, as `Material.images` names it.
    """
    with ThreadPoolExecutor(threads or None) as pool:
        made = list(pool.map(_copies, files, slots))
    out: list[bytes] = []
    levels: list[list[Json]] = [[] for _ in files]
    for side in SIDES:
        for number, (_, copies) in enumerate(made):
            for width, height, data in copies:
                if max(width, height) == side:
                    levels[number].append({"file": len(out), "width": width, "height": height})
                    out.append(data)
    for entry in images:
        if "file" not in entry:
            continue
        number = entry["file"]
        size = made[number][0]
        if size is not None:
            entry["width"], entry["height"] = size
        if levels[number]:
            entry["levels"] = levels[number]
        entry["file"] = len(out) + number
    return out + files


def _copies(data: bytes, slots: set[str]) -> tuple[tuple[int, int] | None, list[Level]]:
    """An image's width and height if it can be decoded, and its copies."""
    try:
        (width, height), texels = _texels(data)
    except Error:
        return _claimed(data), []
    if len(data) <= _LEAST_BYTES:
        return (width, height), []
    kept: list[Level] = []
    left = _SHARE * len(data)
    for side in SIDES:
        if 2 * side > max(width, height):
            break
        small = _encoded(texels, _fitted(width, height, side), is_color=all(map(_is_color, slots)))
        most = left if kept else max(left, _SMALLEST_SHARE * len(data))
        if len(small[2]) <= most:
            kept.append(small)
            left -= len(small[2])
    return (width, height), kept


def _texels(data: bytes) -> tuple[tuple[int, int], NDArray[np.uint8]]:
    """An image's width and height, and its texels; those of a large JPEG at a half, a quarter or an
    eighth of its size, but no smaller than the largest copy, which takes a tenth of the time."""
    from PIL import Image

    if mime_type(data) == "image/jpeg":
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", Image.DecompressionBombWarning)
                with Image.open(io.BytesIO(data)) as image:
                    size = image.size
                    image.draft("RGB", (SIDES[-1], SIDES[-1]))
                    if image.mode == "RGB" and image.size != size:
                        return size, np.asarray(image.convert("RGBA"), np.uint8)
        except Exception:  # Pillow's plugins raise whatever they like on damaged files
            pass
    texels = decode(data, "an image")
    return (texels.shape[1], texels.shape[0]), texels


def _fitted(width: int, height: int, side: int) -> tuple[int, int]:
    """The width and height of a copy of so many texels on the longest side."""
    factor = side / max(width, height)
    return max(round(width * factor), 1), max(round(height * factor), 1)


def _claimed(data: bytes) -> tuple[int, int] | None:
    """What a KTX2 file that cannot be decoded says of its size."""
    if data[1:7] != b"KTX 20" or len(data) < 28:
        return None
    width, height = (int.from_bytes(data[at : at + 4], "little") for at in (20, 24))
    return (width, height) if width and height else None


def _is_color(slot: str) -> bool:
    """Whether a slot shows its image's colours, so that an eye is all that they must please."""
    return slot in _COLORS or "color" in slot.lower() or slot.endswith("/diffuseTexture")


def _encoded(texels: NDArray[np.uint8], size: tuple[int, int], is_color: bool) -> Level:
    """A copy of this width and height. Each channel is averaged by itself, as a
    graphics card's mip levels are: what alpha hides may still matter beside a mask's edge."""
    from PIL import Image

    channels = 3 if int(texels[..., 3].min()) == 255 else 4
    bands = [
        Image.fromarray(np.ascontiguousarray(texels[..., k])).resize(size, Image.Resampling.BOX)
        for k in range(channels)
    ]
    out = io.BytesIO()
    if channels == 4:
        image = Image.merge("RGBA", bands)
        image.save(out, "WEBP", quality=90, alpha_quality=100, method=4, exact=True)
    else:
        image = Image.merge("RGB", bands)
        quality, subsampling = (85, 2) if is_color else (92, 0)
        image.save(out, "JPEG", quality=quality, subsampling=subsampling, optimize=True)
    return *size, out.getvalue()
