"""The city's materials, with textures that are made of noise."""

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from umbel import Material
from umbel.io.textures.images import TextureImage

NAMES = ("grass", "asphalt", "brick", "plaster", "concrete", "glass", "roof", "bark", "leaves")
GRASS, ASPHALT, BRICK, PLASTER, CONCRETE, GLASS, ROOF, BARK, LEAVES = range(len(NAMES))

_SIDE = 256
_COLORS = {
    "grass": (96, 122, 62),
    "asphalt": (88, 88, 92),
    "brick": (148, 84, 66),
    "plaster": (208, 194, 168),
    "concrete": (164, 164, 160),
    "glass": (62, 82, 98),
    "roof": (112, 106, 102),
    "bark": (98, 76, 58),
    "leaves": (72, 110, 48),
}


def materials() -> list[Material]:
    """One of each of NAMES."""
    made = []
    for name in NAMES:
        image = TextureImage(data=_png(name), gltf={"image": {"name": name}})
        is_glass = name == "glass"
        made.append(
            Material(
                name=name,
                roughness=0.15 if is_glass else 0.9,
                double_sided=name == "leaves",
                textures={"base_color": {}},
                images={"base_color": image},
            )
        )
    return made


def _png(name: str) -> bytes:
    random = np.random.default_rng(NAMES.index(name))
    color = np.array(_COLORS[name], np.float64)
    shade = 1.0 + 0.10 * _soft_noise(random, 32) + 0.08 * _soft_noise(random, 4)
    rows, columns = np.mgrid[0:_SIDE, 0:_SIDE]
    if name == "brick":  # courses of 16 texels, each second one moved by half a brick
        course, moved = rows // 16, columns + (rows // 16 % 2) * 16
        shade += 0.10 * (random.random((_SIDE, _SIDE))[course, moved // 32 * 32 % _SIDE] - 0.5)
        shade[(rows % 16 < 2) | (moved % 32 < 2)] *= 1.25
    if name == "glass":  # a frame
        edge = (np.minimum(rows, columns) < 10) | (np.maximum(rows, columns) >= _SIDE - 10)
        shade[edge] *= 2.4
    if name == "concrete":  # joints
        shade[(rows % 128 < 2) | (columns % 128 < 2)] *= 0.8
    texels = np.clip(color * shade[:, :, None], 0, 255).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(texels).save(file, "PNG")
    return file.getvalue()


def _soft_noise(random: np.random.Generator, cell: int) -> NDArray[np.float64]:
    """Values in [-1, 1] that repeat without a seam."""
    values = random.uniform(-1, 1, (_SIDE // cell, _SIDE // cell))
    low = np.arange(_SIDE) // cell
    part = np.arange(_SIDE) / cell - low
    part = part * part * (3 - 2 * part)
    high = (low + 1) % len(values)
    rows = values[low] + (values[high] - values[low]) * part[:, None]
    return rows[:, low] + (rows[:, high] - rows[:, low]) * part
