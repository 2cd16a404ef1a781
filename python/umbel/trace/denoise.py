"""Noise taken out of path-traced pictures, with Intel's Open Image Denoise (Afra 2019, a U-Net as
in Chaitanya et al., "Interactive reconstruction of Monte Carlo image sequences using a recurrent
denoising autoencoder", SIGGRAPH 2017)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel.errors import Error
from umbel.geometry.arrays import numbers


def denoise(
    pixels: ArrayLike, albedo: ArrayLike | None = None, normal: ArrayLike | None = None
) -> NDArray[np.float32]:
    """A picture of linear radiance, (height, width, 3), without its noise. `albedo` and `normal`,
    of the same shape (`Film.features`), keep textures and edges sharp; a normal alone is no help.

    Needs the package pyoidn (`pip install "umbel[denoise]"`).
    """
    module = denoiser()
    color = _image("pixels", pixels)
    extras = {
        name: _image(name, given)
        for name, given in (("albedo", albedo), ("normal", normal))
        if given is not None
    }
    if "normal" in extras and "albedo" not in extras:
        raise Error("denoise: a normal needs an albedo beside it")
    for name, extra in extras.items():
        if extra.shape != color.shape:
            raise Error(f"denoise: {name} has shape {extra.shape}, but pixels {color.shape}")
    # A sample that overflowed would spread.
    color = np.nan_to_num(color, nan=0.0, posinf=65504.0, neginf=0.0)
    try:
        made: NDArray[np.float32] = module.denoise(color, hdr=True, **extras)
    except RuntimeError as error:
        raise Error(f"denoise: {error}") from None
    return made


def denoiser() -> Any:
    """The package that does it; refuses, before any work, where there is none."""
    try:
        import pyoidn
    except (ImportError, OSError) as error:
        raise Error(
            "denoising needs Intel's Open Image Denoise: pip install pyoidn, or umbel[denoise] "
            f"({error})"
        ) from None
    return pyoidn


def _image(name: str, given: ArrayLike) -> NDArray[np.float32]:
    array = np.ascontiguousarray(numbers(name, given), np.float32)
    if array.ndim != 3 or array.shape[2] != 3 or not array.size:
        raise Error(f"denoise: {name} must have shape (height, width, 3), not {array.shape}")
    return array
