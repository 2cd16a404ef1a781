"""The JSON that travels in an asset: what made it, and from what. The same build gives the same
text, so it holds no times and no paths."""

from __future__ import annotations

import json
import math
import os
import struct
from typing import Any

_MAGIC = b"\xabUMBL\r\n\x1a"
_MAJOR = 3


def plain(value: Any) -> Any:
    """The value as JSON and any terminal can say it: tuples as lists, NumPy's numbers as plain
    ones, None for what is not finite, "?" for what is no text."""
    if isinstance(value, dict):
        return {plain(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode()
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def encode(metadata: dict[str, Any]) -> str:
    """The metadata as text; equal metadata give equal text."""
    return json.dumps(plain(metadata), sort_keys=True, separators=(",", ":"), allow_nan=False)


def stored(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """The metadata of an asset file of its full length, or None where there is no such file. Reads
    only them, and needs no other part of the package: ten thousand files take a second or so."""
    try:
        with open(path, "rb") as file:
            head = file.read(128)
            magic, major, _, size, whole = struct.unpack_from("<8sHHIQ", head)
            if magic != _MAGIC or major != _MAJOR or os.fstat(file.fileno()).st_size != whole:
                return None
            (count,) = struct.unpack_from("<I", head, 40)
            file.seek(size)
            table = file.read(40 * min(count, 1024))
            for name, _, offset, length, *_ in struct.iter_unpack("<4sIQQQQ", table):
                if name == b"META":
                    file.seek(offset)
                    found = json.loads(file.read(length))
                    return found if isinstance(found, dict) else None
    except (OSError, ValueError, struct.error):
        pass
    return None
