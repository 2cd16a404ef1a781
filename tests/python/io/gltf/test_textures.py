"""Textures of a glTF file that is written."""

from __future__ import annotations

import time
from typing import Any

from umbel.io.gltf.textures import TextureTable
from umbel.io.textures.images import TextureImage


def stored(_: str, image: TextureImage) -> dict[str, Any]:
    assert image.data is not None
    return {"uri": image.data.decode()}


def test_equal_images_samplers_and_textures_are_there_once() -> None:
    table = TextureTable(stored)
    numbers = [
        (table.info("base_color", {}, TextureImage(name, **more)) or {})["index"]
        for name in (b"a", b"b", b"a")
        for more in ({}, {"wrap_u": "clamp"}, {"gltf": {"texture": {"name": "t"}}})
    ]
    assert numbers == [0, 1, 2, 3, 4, 5, 0, 1, 2]
    assert table.root["images"] == [{"uri": "a"}, {"uri": "b"}]
    assert table.root["samplers"] == [{"wrapS": 33071}]


def test_many_textures_take_no_square_of_time() -> None:
    table = TextureTable(stored)
    begin = time.process_time()
    for k in range(30_000):
        assert table.info("base_color", {}, TextureImage(b"%d" % k)) == {"index": k}
    assert time.process_time() - begin < 30  # comparing each with all before takes minutes
