"""The JSON that travels in an asset: what made it, and from what. The same build gives the same
text, so it holds no times and no paths."""

from __future__ import annotations

import json
import math
from typing import Any


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
