"""Smaller copies of an asset's images: when there are any, what they show, what they cost."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import umbel
from umbel.io.textures.images import TextureImage, decode
from umbel.lod.materials import write_materials


def noise(width: int, height: int, channels: int, seed: int = 1) -> np.ndarray:
    """Smooth noise with some grain: neither trivial to compress nor impossible."""
    rng = np.random.default_rng(seed)
    coarse = Image.fromarray(rng.integers(0, 256, (8, 8, channels), dtype=np.uint8))
    smooth = np.asarray(coarse.resize((width, height), Image.Resampling.BICUBIC)).astype(int)
    grain = rng.integers(-12, 13, smooth.shape)
    return np.clip(smooth + grain, 0, 255).astype(np.uint8)


def encoded(texels: np.ndarray, kind: str = "PNG") -> bytes:
    out = io.BytesIO()
    Image.fromarray(texels).save(out, kind)
    return out.getvalue()


def stored(images: dict[str, bytes], **options: Any) -> tuple[dict[str, Any], list[bytes]]:
    """The section of one material with these images, and its files."""
    material = umbel.Material(images={k: TextureImage(v) for k, v in images.items()})
    text, files = write_materials([material], "embed", Path(), **options)
    return json.loads(text), files


def test_large_images_get_small_copies_that_look_the_same() -> None:
    texels = noise(2048, 1024, 3)
    data = encoded(texels)
    root, files = stored({"base_color": data})
    (entry,) = root["images"]
    assert (entry["width"], entry["height"]) == (2048, 1024)
    assert [(x["width"], x["height"]) for x in entry["levels"]] == [(256, 128), (1024, 512)]
    assert files[entry["file"]] == data
    for level in entry["levels"]:
        small = decode(files[level["file"]], "a level")[..., :3]
        step = 2048 // level["width"]
        means = texels.reshape(level["height"], step, level["width"], step, 3).mean(axis=(1, 3))
        assert small.shape == means.shape
        assert np.abs(small - means).mean() < 3
    assert sum(len(files[x["file"]]) for x in entry["levels"]) < 0.15 * len(data)


@pytest.mark.parametrize("shape", [(2100, 1500), (1030, 2060)])
def test_copies_of_jpegs_are_like_those_of_their_texels(shape: tuple[int, int]) -> None:
    data = encoded(noise(*shape, 3), "JPEG")
    root, files = stored({"base_color": data})
    (entry,) = root["images"]
    assert (entry["width"], entry["height"]) == shape
    root, others = stored({"base_color": encoded(decode(data, "a jpeg")[..., :3])})
    (same,) = root["images"]
    assert entry["levels"]
    for mine, theirs in zip(entry["levels"], same["levels"], strict=False):
        assert (mine["width"], mine["height"]) == (theirs["width"], theirs["height"])
        a = decode(files[mine["file"]], "a level").astype(int)
        b = decode(others[theirs["file"]], "a level").astype(int)
        assert np.abs(a - b).mean() < 3


def test_masks_keep_their_alpha() -> None:
    texels = noise(1024, 1024, 4)
    texels[..., 3] = np.where(np.hypot(*(np.mgrid[:1024, :1024] - 512.0)) < 400, 255, 0)
    root, files = stored({"base_color": encoded(texels)})
    small = decode(files[root["images"][0]["levels"][0]["file"]], "a level")
    assert small.shape == (256, 256, 4)
    assert np.abs(small[..., 3] - texels[2::4, 2::4, 3].astype(int)).mean() < 3
    # What alpha hides is kept, too: no dark rims where the mask ends.
    hidden = small[..., 3] == 0
    means = texels.reshape(256, 4, 256, 4, 4).mean(axis=(1, 3))
    assert np.abs(small[hidden].astype(float) - means[hidden])[:, :3].mean() < 12


@pytest.mark.parametrize("side", [64, 256, 400])
def test_small_images_get_none(side: int) -> None:
    root, files = stored({"normal": encoded(noise(side, side, 3))})
    assert "levels" not in root["images"][0]
    assert len(files) == 1


def test_the_smallest_copies_of_all_images_come_first() -> None:
    images = {
        slot: encoded(noise(2048, 2048, 3, seed))
        for seed, slot in enumerate(("base_color", "normal", "emissive"))
    }
    root, files = stored(images)
    ends = [len(files[x["file"]]) for entry in root["images"] for x in entry["levels"][:1]]
    assert sorted(x["levels"][0]["file"] for x in root["images"]) == [0, 1, 2]
    assert sum(ends) < 2e6 / 20 * 3  # so that twenty of them are there at once
    assert {files[x["file"]] for x in root["images"]} == set(images.values())


def test_bytes_are_the_same_for_any_number_of_threads() -> None:
    images = {
        slot: encoded(noise(1024, 512, 3, k)) for k, slot in enumerate(("normal", "emissive"))
    }
    assert stored(images, threads=1) == stored(images, threads=4)


def test_what_cannot_be_decoded_is_kept_as_it_is() -> None:
    data = b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(8) + (4096).to_bytes(4, "little") * 2 + bytes(99999)
    root, files = stored({"base_color": data})
    assert files == [data]
    entry = root["images"][0]
    assert (entry["mimeType"], entry["width"], entry["height"]) == ("image/ktx2", 4096, 4096)
    assert "levels" not in entry
