"""A textured square, and the colours that pictures of it have."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import umbel

RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)
DARK = umbel.Environment(color=(0, 0, 0))
EVEN = umbel.Environment(color=(1, 1, 1))


def png(rows: list[list[tuple[int, ...]]]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.array(rows, np.uint8)).save(file, "PNG")
    return file.getvalue()


def data_uri(data: bytes, kind: str) -> str:
    return f"data:{kind};base64," + base64.b64encode(data).decode()


def write_square(
    path: Path,
    material: dict[str, Any],
    uvs: Any = ((0, 1), (1, 1), (1, 0), (0, 0)),
    image: Any = None,
    sampler: dict[str, int] | None = None,
    **more: Any,
) -> Path:
    """A glTF file of the square [-1, 1] x [-1, 1] at z = 0, which faces +z."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    arrays = [corners, np.array(uvs, np.float32), np.array([0, 1, 2, 0, 2, 3], np.uint32)]
    views, data = [], b""
    for array in arrays:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        data += array.tobytes()
    root: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": data_uri(data, "application/octet-stream")}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5125, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "TEXCOORD_0": 1},
                        "indices": 2,
                        "material": 0,
                    }
                ]
            }
        ],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "materials": [material],
        **more,
    }
    if '"index"' in json.dumps(root["materials"]):
        uri = data_uri(png([[RED, GREEN], [BLUE, WHITE]]), "image/png")
        textures = {
            "textures": [{"source": 0, "sampler": 0}],
            "samplers": [sampler or {}],
            "images": [image or {"uri": uri}],
        }
        root = textures | root
    path.write_text(json.dumps(root))
    return path


def emitting(**use: Any) -> dict[str, Any]:
    """A material that shows its texture as it is, whatever the light."""
    return {
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
        "emissiveFactor": [1, 1, 1],
        "emissiveTexture": {"index": 0, **use},
    }


def seen(mesh: Any, environment: umbel.Environment = DARK, **options: Any) -> Any:
    """The square's colours where a camera right before it sees them."""
    size = {"width": 16, "height": 16, "samples": 4, "max_bounces": 1} | options
    return umbel.render(mesh, camera="0,0,5:0,0,0:22.6", environment=environment, **size)


def names(pixels: Any, rows: tuple[int, ...] = (3, 12), columns: tuple[int, ...] = (3, 12)) -> str:
    """Pixels by the letters of their colours."""
    letters = {(1, 0, 0): "r", (0, 1, 0): "g", (0, 0, 1): "b", (1, 1, 1): "w", (0, 0, 0): "."}
    picked = [pixels[y, x] for y in rows for x in columns]
    return "".join(letters.get(tuple(int(v > 0.5) for v in p), "?") for p in picked)
