"""Images of textures: where they are, and their texels. Nothing is read or decoded before a
picture needs it."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.io.files import read_bytes
from umbel.io.textures.ktx2 import IDENTIFIER, decode_ktx2

#: Pixels of the largest image that is decoded; larger claims are damage or an attack.
_MOST_PIXELS = 1 << 28


@dataclass(frozen=True)
class TextureImage:
    """A KTX2 image, or a PNG, JPEG, WebP, AVIF or other one that Pillow can read, as a file or as
    its bytes, and how texture coordinates address it."""

    data: bytes | None = None
    path: Path | None = None
    wrap_u: str = "repeat"  #: repeat, clamp or mirror
    wrap_v: str = "repeat"
    nearest: bool = False  #: no interpolation between texels
    bottom_up: bool = False  #: v = 0 is the image's bottom, as in OBJ
    #: what else a glTF file says of its "image", "texture" and "sampler": names, filters, extras
    gltf: dict[str, Any] = field(default_factory=dict, hash=False, repr=False)
    #: the glTF extension that a texture names it by, such as EXT_texture_webp
    extension: str = ""
    #: what a reader shows that does not know that extension
    fallback: TextureImage | None = None

    def encoded(self) -> bytes:
        """The image's bytes as they are."""
        if self.data is not None:
            return self.data
        if self.path is None:
            raise Error("an image has neither a file nor data")
        return read_bytes(self.path)

    def texels(self) -> NDArray[np.uint8]:
        """(height, width, 4) uint8 RGBA, the top row first; of the fallback where the image itself
        cannot be decoded."""
        try:
            return decode(self.encoded(), str(self.path or "an image inside the file"))
        except Error:
            if self.fallback is None:
                raise
            return self.fallback.texels()


def mime_type(data: bytes) -> str:
    """What an image's first bytes say it is; "" where they say nothing."""
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return "image/png"
    if data[:3] == b"\xff\xd8\xff":
        return "image/jpeg"
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    if data[1:7] == b"KTX 20":
        return "image/ktx2"
    if data[4:8] == b"ftyp" and data[8:12] in (b"avif", b"avis"):
        return "image/avif"
    return "image/vnd-ms.dds" if data[:4] == b"DDS " else ""


def decode(data: bytes, what: str) -> NDArray[np.uint8]:
    """(height, width, 4) uint8 RGBA of an encoded image."""
    if data.startswith(IDENTIFIER):
        return decode_ktx2(data, what, _MOST_PIXELS)
    try:
        from PIL import Image, UnidentifiedImageError
    except ImportError:
        raise Error("textures need Pillow: pip install pillow") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data)) as image:
                if image.width * image.height > _MOST_PIXELS:
                    raise Error(f"{what} has {image.width} x {image.height} pixels, too many")
                if image.mode.startswith(("I;16", "I")):  # 16 bits a channel: Pillow would clip
                    values = np.asarray(image).astype(np.uint32)
                    low = Image.fromarray((values >> 8).astype(np.uint8))
                    out = np.array(low.convert("RGBA"), np.uint8)
                    out[..., 3] = np.where(values == image.info.get("transparency"), 0, 255)
                    return out
                if image.mode == "F":  # fractions
                    values = np.clip(np.nan_to_num(np.asarray(image)), 0, 1)
                    grey = Image.fromarray(np.rint(255 * values).astype(np.uint8))
                    return np.array(grey.convert("RGBA"), np.uint8)
                if image.format == "PNG":
                    _fit_clear_color(image, depth=data[24])
                return np.ascontiguousarray(image.convert("RGBA"), np.uint8)
    except Error:
        raise
    except UnidentifiedImageError:  # whose message shows an object of Python
        raise Error(f"{what} cannot be decoded: it is damaged or of no known format") from None
    except Exception as error:  # Pillow's plugins raise whatever they like on damaged files
        raise Error(f"{what} cannot be decoded: {error}") from None


def _fit_clear_color(image: Any, depth: int) -> None:
    """Pillow makes pixels 8 bits deep, but leaves the colour of those that are not there."""
    clear = image.info.get("transparency")
    if image.mode == "RGB" and isinstance(clear, tuple) and depth == 16:
        image.info["transparency"] = tuple(value >> 8 for value in clear)
    if image.mode == "L" and isinstance(clear, int) and clear < 1 << depth < 256:
        image.info["transparency"] = clear * 255 // ((1 << depth) - 1)


def beside(folder: Path | None, name: str) -> Path | None:
    """The file `name` below `folder`; None where the name leads elsewhere."""
    relative = PurePosixPath(name.replace("\\", "/"))
    if folder is None or not name or "\0" in name or "://" in name:
        return None
    parts = relative.parts
    if not parts or relative.is_absolute() or ".." in parts or ":" in parts[0]:
        return None
    return folder / relative
