"""Values as JSON that any reader takes, and that is the same for equal values."""

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


def encode(values: dict[str, Any]) -> str:
    """The values as text; equal values give equal text."""
    return json.dumps(plain(values), sort_keys=True, separators=(",", ":"), allow_nan=False)
