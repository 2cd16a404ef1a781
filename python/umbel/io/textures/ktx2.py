"""KTX 2.0 images: Basis Universal (ETC1S and UASTC, what glTF's KHR_texture_basisu has) by the
package opengl-basisu, and plain texels of 8 bits a channel."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_HEADER = struct.Struct("<12s9I")
_LEVEL_INDEX = 80
_NONE, _ZSTD, _ZLIB = 0, 2, 3
_BASIS_REMEDY = "pip install opengl-basisu"

#: Channels of Vulkan's formats of 8 bits a channel, in the order in which they are stored.
_FORMATS = {9: "r", 16: "rg", 23: "rgb", 30: "bgr", 37: "rgba", 44: "bgra"}
_FORMATS |= {number + 6: channels for number, channels in _FORMATS.items()}  # the same in sRGB


def decode_ktx2(data: bytes, what: str, most_pixels: int) -> NDArray[np.uint8]:
    """(height, width, 4) uint8 RGBA of the largest level of the first layer and face."""
    if len(data) < _LEVEL_INDEX + 24:
        raise Error(f"{what} is a KTX2 image that is cut off")
    _, vk_format, _, width, height, _, _, _, _, scheme = _HEADER.unpack_from(data)
    height = max(height, 1)
    if width * height > most_pixels:
        raise Error(f"{what} has {width} x {height} pixels, too many")
    if vk_format in _FORMATS and width:
        return _plain(data, what, _FORMATS[vk_format], (height, width), scheme)
    return _basis(data, what)


def _plain(
    data: bytes, what: str, channels: str, size: tuple[int, int], scheme: int
) -> NDArray[np.uint8]:
    offset, length = struct.unpack_from("<QQ", data, _LEVEL_INDEX)
    expected = size[0] * size[1] * len(channels)
    stored = data[offset : offset + length]
    texels = _unpacked(stored, scheme, expected, what)
    if len(stored) < length or len(texels) < expected:
        raise Error(f"{what} is a KTX2 image that is cut off")
    given = np.frombuffer(texels, np.uint8, expected).reshape(*size, len(channels))
    out = np.zeros((*size, 4), np.uint8)
    out[..., 3] = 255
    for k, channel in enumerate(channels):
        out[..., "rgba".index(channel)] = given[..., k]
    return out


def _unpacked(stored: bytes, scheme: int, expected: int, what: str) -> bytes:
    """A level's texels, no more than are expected."""
    if scheme == _NONE:
        return stored
    try:
        if scheme == _ZLIB:
            return zlib.decompressobj().decompress(stored, expected)
        if scheme == _ZSTD:
            return _zstd(what)(stored, expected)
    except Error:
        raise
    except Exception as error:  # each library has errors of its own
        raise Error(f"{what} cannot be decoded: {error}") from None
    raise Error(f"{what} is a KTX2 image of the supercompression scheme {scheme}, which is unknown")


def _zstd(what: str) -> Callable[[bytes, int], bytes]:
    try:
        import zstandard
    except ImportError:
        raise Error(
            f"{what} is a KTX2 image packed by Zstandard, which needs: pip install zstandard"
        ) from None

    def unpack(stored: bytes, expected: int) -> bytes:
        with zstandard.ZstdDecompressor().stream_reader(stored) as reader:
            texels: bytes = reader.read(expected)
            return texels

    return unpack


def _basis(data: bytes, what: str) -> NDArray[np.uint8]:
    try:
        import opengl_basisu as basis
    except ImportError:
        raise Error(
            f"{what} is a KTX2 image, for which Basis Universal is not installed: {_BASIS_REMEDY}"
        ) from None
    try:
        image: Any = basis.open(data).transcode(basis.Target.RGBA8)
    except Exception as error:  # damage, or a format for which the package has no pixels
        raise Error(f"{what} cannot be decoded: {error}") from None
    return np.ascontiguousarray(image.data, np.uint8)
