"""Images as texels."""

from __future__ import annotations

import pytest

from umbel.errors import Error
from umbel.io.textures.images import decode


@pytest.mark.parametrize("data", [b"hello", b"\x89PNG\r\n\x1a\n" + bytes(12), b""])
def test_what_is_no_image_is_named_as_such(data: bytes) -> None:
    says = "^wood.png cannot be decoded: it is damaged or of no known format$"
    with pytest.raises(Error, match=says):
        decode(data, "wood.png")
