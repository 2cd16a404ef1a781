"""What files say of their coordinates: the unit, the axis to the zenith, the reference system."""

from __future__ import annotations

import re
from pathlib import Path

GLTF = {"unit": "metre", "up": "y"}
"""As the specification of glTF has it."""

_MOST_BYTES = 1 << 16
# Well-known text of either version (OGC 01-009, ISO 19162).
_WKT = re.compile(r"[A-Z_]{2,16}(CS|CRS)\s*[\[(]")


def sidecar(file: Path) -> dict[str, str]:
    """What a .prj file beside a mesh says: `crs`, well-known text. Other files of that name say
    nothing."""
    name = file.name.removesuffix(".gz")
    beside = file.with_name(Path(name).stem + ".prj")
    try:
        with beside.open("rb") as opened:
            data = opened.read(_MOST_BYTES + 1)
    except OSError:
        return {}
    text = data.decode("utf-8-sig", "replace").strip()
    return {"crs": text} if len(data) <= _MOST_BYTES and _WKT.match(text.upper()) else {}
