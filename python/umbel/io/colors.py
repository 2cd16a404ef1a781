"""Colours of vertices in formats that do not say what their numbers mean. Scanners and modellers
write what a screen shows, so they are taken for sRGB."""

from __future__ import annotations

from umbel import _umbel
from umbel.geometry.mesh import Float32Array

#: Floats with a larger one among them are bytes. Blended and lit colours may be above 1 a little.
MOST_BRIGHT = 2.0


def to_linear(colors: Float32Array) -> Float32Array:
    """Of (n, k) channels of sRGB."""
    return _umbel.from_srgb(colors.reshape(-1)).reshape(colors.shape)


def to_srgb(colors: Float32Array) -> Float32Array:
    """Of (n, k) linear channels."""
    return _umbel.to_srgb(colors.reshape(-1)).reshape(colors.shape)
