"""Heatmaps: how many boxes of clusters each pixel's ray pierces, as colours on one scale."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import rows, thread_count, whole
from umbel.geometry.camera import Camera
from umbel.trace.picture import save_picture, save_rgb
from umbel.trace.renderer import native_camera

# From none to the most: black, blue, cyan, green, yellow, red, white.
_COLORS = np.array(
    [
        (0, 0, 0),
        (30, 50, 200),
        (0, 190, 220),
        (60, 200, 60),
        (250, 220, 40),
        (220, 40, 30),
        (255, 255, 255),
    ],
    np.float64,
)
_MARGIN = 8  # of the legend, in pixels


def boxes_per_pixel(
    boxes: ArrayLike, camera: Camera, width: int = 1024, height: int = 768, *, threads: int = 0
) -> NDArray[np.uint32]:
    """(h, w): how many boxes the ray through the middle of each pixel pierces. Overlap of clusters
    costs culling and ray tracing; this shows where.

    boxes: (k, 6) least and greatest corners: `cluster_boxes`, `FrameClusters.boxes`, any others.
    camera: in the boxes' space, with a target.
    """
    return _umbel.boxes_per_pixel(
        rows("boxes", boxes, 6),
        native_camera(camera),
        whole("width", width),
        whole("height", height),
        thread_count(threads),
    ).reshape(height, width)


def heatmap(counts: ArrayLike, most: int | None = None) -> NDArray[np.uint8]:
    """(h, w, 3) colours of counts: black for 0, then blue, cyan, green, yellow and red to white for
    `most` and above (by default the greatest). Pictures to compare need the same `most`."""
    values = np.asarray(counts, np.float64)
    if values.ndim != 2:
        raise Error(f"counts must be (height, width), not of shape {values.shape}")
    top = _top(values, most)
    at = np.clip(values / top, 0, 1) * (len(_COLORS) - 1)
    steps = np.arange(len(_COLORS))
    channels = [np.interp(at, steps, _COLORS[:, k]) for k in range(3)]
    return np.round(np.stack(channels, axis=-1)).astype(np.uint8)


def save_heatmap(path: str | os.PathLike[str], counts: ArrayLike, most: int | None = None) -> None:
    """Writes .png (the heatmap, with a legend) or .exr (the counts as they are)."""
    file = Path(path)
    values = np.asarray(counts)
    if file.suffix.lower() == ".exr":
        save_picture(file, np.repeat(values[..., None].astype(np.float32), 3, axis=2))
        return
    colors = heatmap(values, most)
    save_rgb(file, _with_legend(colors, _top(np.asarray(values, np.float64), most)))


def _top(values: NDArray[np.float64], most: int | None) -> int:
    if most is None:
        return max(1, int(values.max(initial=0)))
    if whole("most", most) == 0:
        raise Error("most must be 1 or more")
    return most


def _with_legend(colors: NDArray[np.uint8], most: int) -> NDArray[np.uint8]:
    """The scale as a bar in the lower left corner, where it fits."""
    from PIL import Image, ImageDraw

    picture: Any = Image.fromarray(colors)
    width, height = min(256, colors.shape[1] - 2 * _MARGIN), 12
    if width < 64 or colors.shape[0] < 8 * _MARGIN:
        return colors
    bar = heatmap(np.tile(np.linspace(0, most, width), (height, 1)), most)
    left, top = _MARGIN, colors.shape[0] - _MARGIN - height
    draw = ImageDraw.Draw(picture)
    draw.rectangle((left - 1, top - 1, left + width, top + height), outline=(255, 255, 255))
    picture.paste(Image.fromarray(bar), (left, top))
    draw.text((left, top - 16), "0", fill=(255, 255, 255))
    right = f"{most} boxes"
    draw.text((left + width - draw.textlength(right), top - 16), right, fill=(255, 255, 255))
    return np.asarray(picture)
