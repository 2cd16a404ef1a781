"""How exactly an asset keeps attributes: bits of normals, tangents, colours and texture
coordinates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from umbel.errors import Error

if TYPE_CHECKING:
    from umbel.lod.lod import Lod


MOST_BITS = {"normal": 16, "tangent": 16, "color": 16, "uv": 24}


def check_attribute_bits(bits: Mapping[str, int]) -> None:
    """Raises if a name or a number is none that `Lod.save` describes."""
    for name, count in bits.items():
        if name not in MOST_BITS:
            raise Error(f"attribute_bits has {name!r}, but only {', '.join(MOST_BITS)} have bits")
        least = 1 if name == "uv" else 2
        if count != 0 and not (isinstance(count, int) and least <= count <= MOST_BITS[name]):
            raise Error(
                f"{name} bits must be 0 (all) or from {least} to {MOST_BITS[name]}, not {count!r}"
            )


def attribute_precision(
    lods: Sequence[Lod], exact: bool | None, bits: Mapping[str, int] | None
) -> tuple[int, int, int, float]:
    """What the format takes: bits of normals, tangents and colours, and the step of texture
    coordinates. What `bits` does not say keeps every bit where `exact` is true or, if that is None,
    where positions do; else it has as many bits as go with those of positions."""
    given = dict(bits or {})
    check_attribute_bits(given)
    if exact is None:
        exact = any(lod.config["position_step"] == 0 for lod in lods)
    usual = (
        dict.fromkeys(MOST_BITS, 0) if exact else _beside(max(map(_position_bits, lods), default=0))
    )
    return _stored({**usual, **given})


def exact_but(bits: Mapping[str, int] | None) -> tuple[int, int, int, float]:
    """The same where every bit is kept but of what `bits` says."""
    given = dict(bits or {})
    check_attribute_bits(given)
    return _stored({**dict.fromkeys(MOST_BITS, 0), **given})


def _stored(bits: Mapping[str, int]) -> tuple[int, int, int, float]:
    uv_step = 2.0 ** -bits["uv"] if bits["uv"] else 0.0
    return bits["normal"], bits["tangent"], bits["color"], uv_step


def _beside(position_bits: int) -> dict[str, int]:
    """With 16 bits or fewer go 8 for normals (to within a degree) and 12 for texture coordinates
    (half a texel of a picture of 4096), with 18 or more 10 and 14."""
    more = min(max(position_bits - 16, 0), 2)
    return {"normal": 8 + more, "tangent": 8 + more, "color": 8, "uv": 12 + more}


def _position_bits(lod: Lod) -> int:
    """Of the steps along the mesh's longest side; 24, those of floats, where there is no grid."""
    step = float(lod.config["position_step"])
    boxes = lod.tables.clusters
    if step == 0:
        return 24
    if len(boxes) == 0:
        return 0
    side = float(np.max(boxes["box_max"].max(axis=0) - boxes["box_min"].min(axis=0)))
    return math.ceil(math.log2(side / step)) if side > step else 0
