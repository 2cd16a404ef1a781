"""Images of textures: which encodings are decoded, and what is said of the others."""

from __future__ import annotations

import base64
import io
import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, features

import umbel
from helpers.pictures import BLUE, GREEN, RED, WHITE, data_uri, emitting, names, seen, write_square
from umbel.io.textures.images import decode
from umbel.trace.shading import Shading

KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"
#: 8 x 8 texels, red and green above blue and white, as basisu 2.1 encodes them.
ETC1S = base64.b64decode(
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgAAAAA"
    "AAAAiQAAAAAAAABBAQAAAAAAAAIAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAAAAA/AAAA"
    "AAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAgArAAAACQAAAC0AAAAAAAAAAAAA"
    "AAAAAAACAAAAAAAAAAAAAAAgwEQAAAAAAADiBAQwEQAAAAAAgCQQACYAAAAAAAAQAoAJAAAAAAAABDA2rKqqqlJVVVUF"
    "AMFEAAAAAAAA8l+NAJgBAAAAAABAwggwIUAAAAAABJFTCgAmAAAAAAAAEEAAEAY="
)
UASTC = base64.b64decode(
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAAAAAAAaAAAACwAAACUAAAALAAAAAAAAAAA"
    "AAAAAAAAAAAAAADAAAAAAAAAAEAAAAAAAAAAQAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AAAA"
    "AAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAAB/fwAA9x8A4B96AAAAAAAAAAAA"
    "ABfgH+AfAg8AAAAAAAAAAAAXAOD/HwLgAQAAAAAAAAAA9////x987wEAAAAAAAAAAA=="
)


def plain_ktx2(vk_format: int, texels: np.ndarray, scheme: int = 0) -> bytes:
    height, width, _ = texels.shape
    level = texels.tobytes()
    packed = {0: level, 3: zlib.compress(level)}.get(scheme, level)
    header = struct.pack("<12s9I", KTX2, vk_format, 1, width, height, 0, 0, 1, 1, scheme)
    index = struct.pack("<4I2Q", 0, 0, 0, 0, 0, 0)
    return header + index + struct.pack("<3Q", 104, len(packed), len(level)) + packed


def quadrants(channels: str = "rgba") -> np.ndarray:
    rows = np.array([[RED, GREEN], [BLUE, WHITE]], np.uint8)
    rgba = np.concatenate([rows, np.full((2, 2, 1), 255, np.uint8)], axis=2)
    return np.ascontiguousarray(rgba[:, :, ["rgba".index(c) for c in channels]])


def plain_png(depth: int, kind: int, pixels: bytes, width: int, clear: tuple[int, ...]) -> bytes:
    """One row of pixels; those of one colour are fully transparent."""

    def chunk(name: bytes, data: bytes) -> bytes:
        ends = struct.pack(">I", len(data)), struct.pack(">I", zlib.crc32(name + data))
        return ends[0] + name + data + ends[1]

    header = struct.pack(">2I5B", width, 1, depth, kind, 0, 0, 0)
    parts = [chunk(b"IHDR", header), chunk(b"tRNS", struct.pack(f">{len(clear)}H", *clear))]
    parts += [chunk(b"IDAT", zlib.compress(b"\0" + pixels)), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def textured(tmp_path: Path, data: bytes, kind: str) -> Path:
    texture = {"sampler": 0, "extensions": {"KHR_texture_basisu": {"source": 0}}}
    return write_square(
        tmp_path / "a.gltf",
        emitting() | {"name": "paint"},
        image={"uri": data_uri(data, kind)},
        sampler={"magFilter": 9728},
        textures=[texture],
    )


@pytest.mark.parametrize("data", [ETC1S, UASTC], ids=["etc1s", "uastc"])
def test_basis_universal_shows_its_texels(tmp_path: Path, data: bytes) -> None:
    assert decode(data, "x").shape == (8, 8, 4)
    assert names(seen(textured(tmp_path, data, "image/ktx2"))) == "rgbw"


@pytest.mark.parametrize("scheme", [0, 3])
@pytest.mark.parametrize(
    ("vk_format", "channels"), [(37, "rgba"), (43, "rgba"), (23, "rgb"), (50, "bgra")]
)
def test_plain_texels_of_ktx2(vk_format: int, channels: str, scheme: int) -> None:
    data = plain_ktx2(vk_format, quadrants(channels), scheme)
    assert np.array_equal(decode(data, "x"), quadrants())


def test_channels_that_ktx2_lacks_are_black_and_opaque() -> None:
    texels = np.array([[[7, 9]]], np.uint8)
    assert decode(plain_ktx2(16, texels), "x").tolist() == [[[7, 9, 0, 255]]]


@pytest.mark.parametrize("source", [ETC1S, UASTC, plain_ktx2(37, quadrants(), 3)])
def test_damaged_ktx2_is_an_error_and_never_a_crash(source: bytes) -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        data = bytearray(source[: rng.integers(12, len(source) + 1)])
        for at in rng.integers(12, len(source), 3):
            if at < len(data):
                data[at] = rng.integers(256)
        try:
            texels = decode(bytes(data), "wood.ktx2")
        except umbel.Error as error:
            assert "wood.ktx2" in str(error)
        else:
            assert texels.dtype == np.uint8 and texels.shape[2] == 4


@pytest.mark.parametrize("size", [(1 << 31, 1 << 31), (1 << 20, 1 << 20)])
def test_sizes_that_no_image_has_are_refused(size: tuple[int, int]) -> None:
    data = bytearray(UASTC)
    data[20:28] = struct.pack("<2I", *size)
    with pytest.raises(umbel.Error, match="too many"):
        decode(bytes(data), "x")


def test_a_package_that_is_missing_is_one_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "opengl_basisu", None)
    mesh = umbel.load(textured(tmp_path, UASTC, "image/ktx2"))
    with pytest.warns(umbel.LoadWarning) as said:
        Shading(mesh)
    assert len(said) == 1
    sentence = str(said[0].message)
    assert "paint" in sentence and "pip install opengl-basisu" in sentence


@pytest.mark.parametrize("kind", ["webp", "avif"])
def test_webp_and_avif(tmp_path: Path, kind: str) -> None:
    if not features.check(kind):
        pytest.skip(f"Pillow has no {kind}")
    file = io.BytesIO()
    Image.fromarray(quadrants().repeat(8, 0).repeat(8, 1)).save(file, kind.upper(), quality=100)
    assert names(seen(textured(tmp_path, file.getvalue(), f"image/{kind}"))) == "rgbw"


@pytest.mark.parametrize(
    ("depth", "pixels", "clear"),
    [(2, b"\x1b", 1), (4, b"\x01\x23", 1), (8, b"\0\1\2\3", 1), (16, b"\0\5\1\5\1\6\2\5", 0x105)],
)
def test_greys_of_any_depth_that_a_png_leaves_out_are_transparent(
    depth: int, pixels: bytes, clear: int
) -> None:
    texels = decode(plain_png(depth, 0, pixels, 4, (clear,)), "x")
    assert texels[0, :, 3].tolist() == [255, 0, 255, 255]


@pytest.mark.parametrize("depth", [8, 16])
def test_the_colour_that_a_png_leaves_out_is_transparent(depth: int) -> None:
    colors = np.array([[9, 8, 7], [9, 8, 6]]) << (depth - 8)
    pixels = colors.astype(f">u{depth // 8}").tobytes()
    texels = decode(plain_png(depth, 2, pixels, 2, tuple(colors[1])), "x")
    assert texels.tolist() == [[[9, 8, 7, 255], [9, 8, 6, 0]]]


@pytest.mark.parametrize("nearest", [False, True])
def test_a_texture_that_is_too_wide_is_made_smaller(tmp_path: Path, nearest: bool) -> None:
    file = io.BytesIO()
    Image.fromarray(quadrants().repeat(50_000, 1)).save(file, "PNG", compress_level=1)
    path = write_square(
        tmp_path / "a.gltf",
        emitting() | {"name": "paint"},
        image={"uri": data_uri(file.getvalue(), "image/png")},
        sampler={"magFilter": 9728 if nearest else 9729},
    )
    with pytest.warns(umbel.LoadWarning, match="'paint' gets .* 100000 x 2 .* 65536 x 2$"):
        assert names(seen(path), rows=(2, 13)) == "rgbw"


@pytest.mark.parametrize("image", [{"uri": "../out.png"}, {"uri": "data:image/png;base64,!"}, {}])
def test_a_texture_without_an_image_is_said(tmp_path: Path, image: Any) -> None:
    path = write_square(tmp_path / "a.gltf", emitting() | {"name": "paint"}, images=[image])
    with pytest.warns(umbel.LoadWarning, match="'paint'"):
        Shading(umbel.load(path))


def test_a_real_scene_of_ktx2_has_colours(data: Path) -> None:
    path = data / "textured" / "jet-fighter.glb"
    if not path.exists():
        pytest.skip(f"no {path}")
    look = Shading(umbel.load(path))
    assert len(look.textures) >= 3
