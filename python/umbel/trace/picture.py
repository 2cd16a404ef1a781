"""From radiance to image files: exposure, tone mapping, PNG and OpenEXR."""

from __future__ import annotations

import math
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel.errors import Error
from umbel.geometry.arrays import numbers
from umbel.io.files import replacing

FORMATS = (".png", ".exr")
_MIDDLE_GREY = 0.18
_BRIGHT = 1.6  # before the curve, which shows it as 0.94 of white
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
_ROWS = 256  # of a picture that are tone-mapped at once


def auto_exposure(pixels: ArrayLike) -> float:
    """The exposure in stops that puts the geometric mean of a picture's luminance, of what is not
    black, at a middle grey, or less where a tenth of the picture would turn white. Between -8
    and 8."""
    luminance = _rgb(pixels) @ _LUMINANCE
    lit = luminance[np.isfinite(luminance) & (luminance > 1e-5)]
    if not lit.size:
        return 0.0
    stops = math.log2(_MIDDLE_GREY) - float(np.log2(lit).mean(dtype=np.float64))
    stops = min(stops, math.log2(_BRIGHT / float(np.percentile(lit, 90))))
    return min(max(stops, -8.0), 8.0)


def tone_map(pixels: ArrayLike, exposure: float | str = "auto") -> NDArray[np.uint8]:
    """(h, w, 3) linear radiance as (h, w, 3) uint8 sRGB: times 2 ** exposure, then a filmic curve
    (Narkowicz's 2015 fit of ACES: soft shoulder, slight toe), then sRGB's transfer function."""
    rgb = _rgb(pixels)
    stops = auto_exposure(rgb) if exposure == "auto" else _stops(exposure)
    out = np.empty(rgb.shape, np.uint8)
    for row in range(0, len(rgb), _ROWS):
        out[row : row + _ROWS] = _encoded(rgb[row : row + _ROWS], 2.0**stops)
    return out


def _encoded(rgb: NDArray[np.float32], exposure: float) -> NDArray[np.float64]:
    x = np.clip(np.nan_to_num(rgb.astype(np.float64) * exposure), 0.0, 1e6)
    x = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)
    return np.round(_srgb(x) * 255)


def save_picture(
    path: str | os.PathLike[str], pixels: ArrayLike, exposure: float | str = "auto"
) -> None:
    """Writes .png (tone-mapped) or .exr (linear radiance as it is, 32-bit floats). The file is
    written beside its name and renamed when whole."""
    file = Path(path)
    kind = file.suffix.lower()
    if kind == ".png":
        save_rgb(file, tone_map(pixels, exposure))
    elif kind == ".exr":
        _save_exr(file, _rgb(pixels))
    else:
        raise Error(f"{file}: pictures are {' or '.join(FORMATS)}, not '{file.suffix}'")


def feature_paths(picture: Path) -> tuple[Path, Path]:
    """Where `save_features` writes albedo and normals."""
    albedo, normal = (
        picture.with_name(f"{picture.stem}-{name}{picture.suffix}") for name in ("albedo", "normal")
    )
    return albedo, normal


def save_features(
    path: str | os.PathLike[str], albedo: ArrayLike, normal: ArrayLike
) -> tuple[Path, Path]:
    """Writes albedo and normals beside a picture's name, as NAME-albedo and NAME-normal. As .exr
    they are what `Film.features` gives; as .png the albedo is in sRGB, and normals are
    128 + 127 n."""
    paths = feature_paths(Path(path))
    colors, normals = _rgb(albedo), _rgb(normal)
    if paths[0].suffix.lower() == ".exr":
        _save_exr(paths[0], colors)
        _save_exr(paths[1], normals)
    else:
        save_rgb(paths[0], np.round(255 * _srgb(np.clip(colors, 0, 1))).astype(np.uint8))
        save_rgb(paths[1], np.round(128 + 127 * np.clip(normals, -1, 1)).astype(np.uint8))
    return paths


def _srgb(linear: NDArray[Any]) -> NDArray[Any]:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def check_format(path: Path) -> None:
    """Refuses, before any work, a file whose format this installation cannot write."""
    if path.suffix.lower() == ".exr":
        _openexr()
    else:
        _pillow()


def save_rgb(path: Path, rgb: NDArray[np.uint8]) -> None:
    """Writes (h, w, 3) colours as a .png, as they are."""
    image = _pillow().fromarray(rgb)
    with replacing(path) as file:
        image.save(file, "PNG", optimize=True)


def _pillow() -> Any:
    try:
        from PIL import Image
    except ImportError:
        raise Error("PNG files need the package Pillow: pip install pillow") from None
    return Image


def _openexr() -> Any:
    try:
        import OpenEXR
    except ImportError:
        raise Error(
            "EXR files need the package OpenEXR: pip install OpenEXR, or umbel[exr]"
        ) from None
    return OpenEXR


def _save_exr(path: Path, rgb: NDArray[np.float32]) -> None:
    module = _openexr()
    header = {"compression": module.ZIP_COMPRESSION, "type": module.scanlineimage}
    # OpenEXR writes to names only, so its bytes take a way round by a folder of their own.
    with tempfile.TemporaryDirectory() as folder, replacing(path) as file:
        name = os.path.join(folder, "picture.exr")
        try:
            module.File(header, {"RGB": np.ascontiguousarray(rgb)}).write(name)
        except (RuntimeError, ValueError) as error:
            raise Error(f"cannot write {path}: {error}") from None
        file.write(Path(name).read_bytes())


def _rgb(pixels: ArrayLike) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        array = numbers("pixels", pixels).astype(np.float32, copy=False)
    if array.ndim != 3 or array.shape[2] != 3 or not array.size:
        raise Error(f"a picture must have shape (height, width, 3), not {array.shape}")
    return array


def _stops(exposure: float | str) -> float:
    try:
        stops = float(exposure)
    except (TypeError, ValueError):
        raise Error(f"exposure must be 'auto' or a number of stops, not {exposure!r}") from None
    if not math.isfinite(stops) or abs(stops) > 64:
        raise Error(f"exposure must be from -64 to 64 stops, not {stops}")
    return stops
