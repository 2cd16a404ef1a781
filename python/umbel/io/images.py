"""Images of textures: where they are, and their texels. Nothing is read or decoded before a
picture needs it."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.io.files import read_bytes
from umbel.io.ktx2 import IDENTIFIER, decode_ktx2

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

    def texels(self) -> NDArray[np.uint8]:
        """(height, width, 4) uint8 RGBA, the top row first."""
        data = self.data
        if data is None:
            if self.path is None:
                raise Error("an image has neither a file nor data")
            data = read_bytes(self.path)
        return decode(data, str(self.path or "an image inside the file"))


def decode(data: bytes, what: str) -> NDArray[np.uint8]:
    """(height, width, 4) uint8 RGBA of an encoded image."""
    if data.startswith(IDENTIFIER):
        return decode_ktx2(data, what, _MOST_PIXELS)
    try:
        from PIL import Image
    except ImportError:
        raise Error("textures need Pillow: pip install pillow") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data)) as image:
                if image.width * image.height > _MOST_PIXELS:
                    raise Error(f"{what} has {image.width} x {image.height} pixels, too many")
                if image.mode.startswith(("I;16", "I")):  # 16 bits a channel: Pillow would clip
                    high = np.asarray(image).astype(np.uint32) >> 8
                    low = Image.fromarray(high.astype(np.uint8))
                    return np.ascontiguousarray(low.convert("RGBA"), np.uint8)
                return np.ascontiguousarray(image.convert("RGBA"), np.uint8)
    except Error:
        raise
    except Exception as error:  # Pillow's plugins raise whatever they like on damaged files
        raise Error(f"{what} cannot be decoded: {error}") from None


def beside(folder: Path | None, name: str) -> Path | None:
    """The file `name` below `folder`; None where the name leads elsewhere."""
    relative = PurePosixPath(name.replace("\\", "/"))
    if folder is None or not name or "\0" in name or "://" in name:
        return None
    parts = relative.parts
    if not parts or relative.is_absolute() or ".." in parts or ":" in parts[0]:
        return None
    return folder / relative
