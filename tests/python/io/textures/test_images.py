"""Images as texels."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from umbel.errors import Error
from umbel.io.textures.images import decode


@pytest.mark.parametrize("data", [b"hello", b"\x89PNG\r\n\x1a\n" + bytes(12), b""])
def test_what_is_no_image_is_named_as_such(data: bytes) -> None:
    says = "^wood.png cannot be decoded: it is damaged or of no known format$"
    with pytest.raises(Error, match=says):
        decode(data, "wood.png")


def test_floats_are_fractions() -> None:
    out = io.BytesIO()
    Image.fromarray(np.float32([[0, 0.5, 1, 4], [-1, 0.2, np.nan, np.inf]])).save(out, "TIFF")
    texels = decode(out.getvalue(), "grey.tif")
    assert (
        texels[..., 0].tolist() == texels[..., 2].tolist() == [[0, 128, 255, 255], [0, 51, 0, 255]]
    )
    assert (texels[..., 3] == 255).all()
